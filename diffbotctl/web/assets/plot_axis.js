// Axes of plots: round numbers beside a picture, and where a value lies between its ends.

const ROUND_STEPS = [1, 2, 5, 10]; // times a power of ten
const TOLERANCE = 1e-9; // values that vary less, relative to their size, are a constant
const CONSTANT_MARGIN = 0.5; // room around a constant: share of its value, or units around zero
const LABEL_MAX = 1e6; // greater numbers are written with an exponent
const DECIMALS_MAX = 6;

/** The smallest round step that is not below `spacing`. */
function roundStep(spacing) {
  const power = 10 ** Math.floor(Math.log10(spacing));
  return power * (ROUND_STEPS.find((step) => step * power >= spacing * (1 - TOLERANCE)) ?? 10);
}

function multiples(step, minimum, maximum) {
  const first = Math.ceil(minimum / step - TOLERANCE);
  const last = Math.floor(maximum / step + TOLERANCE);
  return Array.from({ length: Math.max(last - first + 1, 0) }, (_, i) => (first + i) * step);
}

/** An axis from `minimum` to `maximum` with about `count` round values, at least two. */
export function makeAxis(minimum, maximum, count) {
  if (maximum - minimum <= TOLERANCE * Math.max(Math.abs(minimum), Math.abs(maximum), TOLERANCE)) {
    const margin = CONSTANT_MARGIN * Math.abs(minimum) || CONSTANT_MARGIN;
    [minimum, maximum] = [minimum - margin, maximum + margin];
  }
  let spacing = (maximum - minimum) / Math.max(count, 1);
  let step = roundStep(spacing);
  let ticks = multiples(step, minimum, maximum);
  while (ticks.length < 2) {
    spacing /= 2;
    step = roundStep(spacing);
    ticks = multiples(step, minimum, maximum);
  }
  const decimals = Math.max(0, -Math.floor(Math.log10(step) + TOLERANCE));
  return {
    ticks,
    /** 0 at the minimum, 1 at the maximum. */
    share: (value) => (value - minimum) / (maximum - minimum),
    /** A tick as text: all of an axis have the same number of decimals. */
    label: (value) => {
      if (Math.abs(value) >= LABEL_MAX || decimals > DECIMALS_MAX) return value.toPrecision(3);
      const text = value.toFixed(decimals);
      return +text === 0 ? text.replace("-", "") : text;
    },
  };
}
