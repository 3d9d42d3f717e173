/* labels.js -- where the name and value of an arrow stand: beside it, and on no body. */

const LETTER = 7; // CSS pixels, of 12px text
const LINE = 14;
const REACHES = [6, 26]; // from the arrow: where there is no room beside it, farther off

/* Circles [x, y, radius] that cover a way of points on the screen. */
function covered(points, radius = 3) {
  const found = [];
  points.forEach(([x, y], k) => {
    const [px, py] = points[Math.max(0, k - 1)];
    const pieces = Math.min(200, Math.ceil(Math.hypot(x - px, y - py) / 10)) || 1;
    for (let i = 1; i <= pieces; i++) {
      const part = i / pieces;
      found.push([px + part * (x - px), py + part * (y - py), radius]);
    }
  });
  return found.filter(([x, y]) => Number.isFinite(x) && Number.isFinite(y));
}

/* How deep circles reach into a box [left, top, right, bottom]. */
function overlap([left, top, right, bottom], circles) {
  let sum = 0;
  for (const [x, y, r] of circles) {
    const dx = Math.max(left - x, 0, x - right);
    const dy = Math.max(top - y, 0, y - bottom);
    sum += Math.max(0, r - Math.hypot(dx, dy));
  }
  return sum;
}

/* The boxes that a text may have beside an arrow: beyond its tip, at its sides, behind its foot. */
function boxes(from, to, width) {
  const length = Math.hypot(to[0] - from[0], to[1] - from[1]) || 1;
  const [tx, ty] = [(to[0] - from[0]) / length, (to[1] - from[1]) / length];
  const middle = [(from[0] + to[0]) / 2, (from[1] + to[1]) / 2];
  const [left, right] = [[ty, -tx], [-ty, tx]];
  const places = [[to, [tx, ty]], [to, right], [to, left], [middle, right], [middle, left]];
  places.push([from, [-tx, -ty]], [from, right], [from, left]);
  const way = (x) => (Math.abs(x) < 0.3 ? 0 : Math.sign(x));
  return REACHES.flatMap((reach) =>
    places.map(([[x, y], [ax, ay]]) => [
      x + reach * ax + ((way(ax) - 1) * width) / 2,
      y + reach * ay + ((way(ay) - 1) * LINE) / 2,
    ])
  );
}

/* Places the texts of all arrows of a picture; each stays where it is as long as it is free there. */
function placeLabels(arrows, bodies, width, height) {
  const taken = bodies.concat(arrows.flatMap(({ from, to }) => covered([from, to], 2)));
  for (const arrow of arrows) {
    const wide = arrow.label.textContent.length * LETTER;
    let best = null;
    boxes(arrow.from, arrow.to, wide).forEach(([x, y], k) => {
      const left = Math.max(2, Math.min(x, width - wide - 2));
      const top = Math.max(2, Math.min(y, height - LINE - 2));
      const stays = k === arrow.label.choice ? 0 : 1.5;
      const cost = overlap([left, top, left + wide, top + LINE], taken) + stays + 0.1 * k;
      if (!best || cost < best.cost) best = { cost, left, top, k };
    });
    const { left, top, k } = best;
    arrow.label.choice = k;
    arrow.label.setAttribute("x", left);
    arrow.label.setAttribute("y", top + LINE - 3.5);
    const middle = top + LINE / 2;
    taken.push(...covered([[left, middle], [left + wide, middle]], LINE / 2));
  }
}
