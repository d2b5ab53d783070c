// Numbers as people read them.

export const count = (x) => Math.round(x).toLocaleString('en-US');

export function number(x, digits = 3) {
  if (x === 0) return '0';
  if (!Number.isFinite(x)) return String(x);
  const size = Math.abs(Number(x.toPrecision(digits)));
  if (size >= 1e5 || size < 1e-3) return x.toExponential(digits - 1).replace('e+', 'e').replace('-', '−').replace('e-', 'e−');
  if (size >= 10 ** digits) return count(x).replace('-', '−');
  return x.toPrecision(digits).replace(/(\.\d*?)0+$/, '$1').replace(/\.$/, '').replace('-', '−');
}

// A length with the unit that suits it.
export function metres(x) {
  const size = Math.abs(Number(x.toPrecision(3)));
  if (size === 0) return '0 m';
  return size < 1e-3 ? `${number(x * 1e6)} µm` : size < 1 ? `${number(x * 1e3)} mm` : `${number(x)} m`;
}

// An element with attributes and children; text is never read as HTML.
export function make(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith('on')) element.addEventListener(name.slice(2), value);
    else element.setAttribute(name, value);
  }
  element.append(...children);
  return element;
}
