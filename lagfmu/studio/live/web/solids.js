/* solids.js -- boxes and cylinders in the flat picture: their outline, and the faces that are seen. */

const ROUND = 24; // corners of a circle

const along = (p, d, ...factors) => p.map((x, i) => x + factors.reduce((sum, f, k) => sum + f * d[k][i], 0));

/* Faces as points in the world, counterclockwise from outside; in the plane one. */
function boxFaces(s, look) {
  const center = s.center(look);
  const axes = s.axes.map((axis) => axis(look));
  const half = s.size(look).map((x) => Math.abs(x) / 2);
  const corners = [[1, 1], [-1, 1], [-1, -1], [1, -1]];
  if (axes.length === 2) return [corners.map(([i, j]) => along(center, axes, i * half[0], j * half[1]))];
  return [0, 1, 2].flatMap((k) => {
    const [i, j] = [(k + 1) % 3, (k + 2) % 3];
    const turned = [axes[i], axes[j], axes[k]];
    return [1, -1].map((side) => {
      const face = corners.map(([a, b]) => along(center, turned, a * half[i], b * half[j], side * half[k]));
      return side > 0 ? face : face.reverse();
    });
  });
}

/* The ends of a cylinder; in the plane a rectangle. */
function rodFaces(s, look) {
  const [a, b] = s.points.map((p) => p(look));
  const r = Math.abs(s.radius(look));
  const length = between(a, b) || 1;
  const axis = a.map((x, i) => (b[i] - x) / length);
  if (axis.length === 2) {
    const across = [[-axis[1], axis[0]]];
    return [[along(a, across, r), along(a, across, -r), along(b, across, -r), along(b, across, r)]];
  }
  const [u, v] = squareTo(axis);
  const circle = (center) =>
    Array.from({ length: ROUND }, (_, k) => {
      const angle = (2 * Math.PI * k) / ROUND;
      return along(center, [u, v], r * Math.cos(angle), r * Math.sin(angle));
    });
  return [circle(a).reverse(), circle(b)];
}

/* Two unit vectors that are right-handed with a third. */
function squareTo([x, y, z]) {
  const start = Math.abs(z) < 0.9 ? [0, 0, 1] : [1, 0, 0];
  const cross = (a, b) => [0, 1, 2].map((i) => a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3]);
  const u = cross(start, [x, y, z]);
  const size = Math.hypot(...u);
  const unit = u.map((c) => c / size);
  return [unit, cross([x, y, z], unit)];
}

/* Twice the area that points on the screen go round: negative counterclockwise, as y points down. */
const turning = (points) =>
  points.reduce((sum, [x, y], k) => {
    const [nx, ny] = points[(k + 1) % points.length];
    return sum + x * ny - nx * y;
  }, 0);

/* The least convex polygon about points (Andrew 1979). */
function hull(points) {
  const sorted = [...points].sort(([a, b], [c, d]) => a - c || b - d);
  const half = (list) => {
    const found = [];
    for (const p of list) {
      while (found.length > 1 && turning([found.at(-2), found.at(-1), p]) <= 0) found.pop();
      found.push(p);
    }
    return found.slice(0, -1);
  };
  return [...half(sorted), ...half(sorted.reverse())];
}

/* A path about a solid and the faces that look at the reader. */
function solidPath(faces) {
  const seen = faces.length > 1 ? faces.filter((face) => turning(face) < 0) : [];
  return [hull(faces.flat()).reverse(), ...seen].map((face) => `M${pointsOf(face)}Z`).join("");
}
