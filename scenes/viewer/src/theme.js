// The colours of style.css, for what is drawn on canvases; and when they change.

const dark = window.matchMedia('(prefers-color-scheme: dark)');

export function theme() {
  const style = getComputedStyle(document.documentElement), ink = (name) => style.getPropertyValue(`--${name}`).trim();
  return {
    dark: dark.matches, background: ink('stage'), wall: ink('wall'), line: ink('line'), accent: ink('accent'), point: ink('point'), normal: ink('normal'),
    force: ink('force'),
  };
}

export const onTheme = (callback) => dark.addEventListener('change', callback);
