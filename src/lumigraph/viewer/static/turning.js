// Pictures turned clockwise by quarters.

/** A step (x, y), y downwards, turned clockwise by a number of quarters. */
export function turned([x, y], quarters) {
  return [[x, y], [-y, x], [-x, -y], [y, -x]][((quarters % 4) + 4) % 4];
}
