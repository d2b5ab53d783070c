// Ticks of axes: round numbers, and powers of ten.

export function linearTicks(low, high, most) {
  const rough = (high - low) / Math.max(most, 1);
  if (!(rough > 0)) return [low];
  const decade = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((k) => k * decade).find((s) => s >= rough * 0.999);
  const ticks = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; ++k) ticks.push(Math.abs(k * step) < 1e-12 * step ? 0 : k * step);
  return ticks;
}

// Powers of ten between two powers of ten.
export function powerTicks(low, high, most) {
  const step = Math.max(1, Math.ceil((high - low) / Math.max(most, 1)));
  const ticks = [];
  for (let power = Math.ceil(low); power <= high; power += step) ticks.push(power);
  return ticks;
}

const SUPER = {'-': '⁻', 0: '⁰', 1: '¹', 2: '²', 3: '³', 4: '⁴', 5: '⁵', 6: '⁶', 7: '⁷', 8: '⁸', 9: '⁹'};
export const powerName = (power) => (power === 0 ? '1' : power === 1 ? '10' : `10${[...String(power)].map((c) => SUPER[c]).join('')}`);

export function tickName(x) {
  const size = Math.abs(x);
  const name = size >= 1e6 ? `${+(x / 1e6).toPrecision(3)}M` : size >= 1e4 ? `${+(x / 1e3).toPrecision(3)}k` : String(+x.toPrecision(6));
  return name.replace(/-/g, '−');
}
