// The colours of bodies: what they may tell, and their legends.
import {Color} from 'three';
import {powerName} from './axis.js';

const GOLDEN = 0.61803398875;

// Lightness, chroma and hue (turns) of OKLCH as linear red, green, blue.
function oklch(l, c, h) {
  const a = c * Math.cos(2 * Math.PI * h), b = c * Math.sin(2 * Math.PI * h);
  const [x, y, z] = [l + 0.3963377774 * a + 0.2158037573 * b, l - 0.1055613458 * a - 0.0638541728 * b,
    l - 0.0894841775 * a - 1.291485548 * b].map((v) => v ** 3);
  const clamp = (v) => Math.min(Math.max(v, 0), 1);
  return [clamp(4.0767416621 * x - 3.3077115913 * y + 0.2309699292 * z),
    clamp(-1.2684380046 * x + 2.6097574011 * y - 0.3413193965 * z),
    clamp(-0.0041960863 * x - 0.7034186147 * y + 1.707614701 * z)];
}

const hex = (text) => new Color(text).toArray();
const css = (rgb) => `#${new Color(...rgb).getHexString()}`;

// Straight lines between colours, in the linear space that three lights in.
function ramp(stops) {
  const colours = stops.map(hex);
  return (t) => {
    const at = Math.min(Math.max(t, 0), 1) * (colours.length - 1), i = Math.min(Math.floor(at), colours.length - 2);
    return colours[i].map((v, k) => v + (at - i) * (colours[i + 1][k] - v));
  };
}

const HEAT = ramp(['#24345c', '#2f6690', '#3a9b9b', '#8cc084', '#f2d16b', '#f0843c']);
const AIM = ramp(['#1c6b70', '#45a29e', '#a9d3c5', '#f3ead7', '#f0b27a', '#d9603f', '#a02334']);
const AWAKE = hex('#e0954a'), FROZEN = hex('#7c98b3'), NOBODY = hex('#aab2bd'), CALM = hex('#c3c9d1');

const byNumber = (i) => oklch(0.7 + 0.08 * ((i * 0.381966) % 1), 0.095, (0.58 + i * GOLDEN) % 1);
const power = (x) => powerName(Math.round(Math.log10(x)));

// Each: name; contacts: whether it needs them; colours(frame, paint) with paint(body, [r, g, b]); legend: items or a bar.
export function colourModes(head) {
  const bodies = head.bodies.kind.length;
  const aim = head.tolerance;
  const each = (colour) => (frame, paint) => {
    for (let i = 0; i < bodies; ++i) paint(i, colour(frame, i));
  };
  const numbers = Array.from({length: bodies}, (_, i) => byNumber(i));
  const byIsland = (frame, paint) => {
    const members = new Int32Array(bodies);
    for (const island of frame.island) if (island >= 0) ++members[island];
    for (let i = 0; i < bodies; ++i) {
      const island = frame.island[i] ?? -1;  // there are none of bodies that are added later
      paint(i, frame.frozen[i] ? FROZEN : island < 0 || members[island] < 2 ? NOBODY : numbers[island]);
    }
  };
  // An impulse that carries the typical weight through a step is in the middle.
  const masses = head.bodies.mass.filter((m) => m > 0).sort((a, b) => a - b);
  const weight = (masses[masses.length >> 1] ?? 1) * (Math.hypot(...head.gravity) || 9.81) * head.dt;
  const low = Math.floor(Math.log10(weight) - 1), decades = 4;
  const press = (x) => (x > 0 ? HEAT((Math.log10(x) - low) / decades) : CALM);
  const toAim = (x) => (x > 0 ? AIM((Math.log10(x / aim) + 3) / 6) : CALM);
  const bar = (colour, from, to, ticks, unit) => ({
    gradient: Array.from({length: 13}, (_, i) => css(colour(from + ((to - from) * i) / 12))), ticks, unit,
  });
  return [
    {id: 'body', name: 'Body', contacts: false, colours: each((frame, i) => (head.bodies.kind[i] === 'dynamic' ? numbers[i] : NOBODY)), legend: {items: []}},
    {id: 'island', name: 'Island', contacts: false,
      colours: byIsland, legend: {items: [[css(FROZEN), 'frozen'], [css(NOBODY), 'alone'], [null, 'a colour for each island']]}},
    {id: 'awake', name: 'Awake or frozen', contacts: false,
      colours: each((frame, i) => (head.bodies.kind[i] !== 'dynamic' ? NOBODY : frame.frozen[i] ? FROZEN : AWAKE)),
      legend: {items: [[css(AWAKE), 'awake'], [css(FROZEN), 'frozen']]}},
    {id: 'impulse', name: 'Impulse', contacts: true, colours: each((frame, i) => press(frame.contacts.press[i])),
      legend: {...bar(HEAT, 0, 1, [0, 1, 2, 3, 4].map((d) => [d / decades, power(10 ** (low + d))]), 'largest press, N s'),
        items: [[css(CALM), 'none']]}},
    {id: 'accuracy', name: 'Accuracy', contacts: false, colours: each((frame, i) => toAim(frame.accuracy[i])),
      legend: {...bar(AIM, 0, 1, [[0, power(aim / 1e3)], [0.5, 'aim'], [1, power(aim * 1e3)]], 'natural map of the island, of v_ref'),
        items: [[css(CALM), 'not solved']]}},
  ];
}
