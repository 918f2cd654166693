// The solutions at a value of the parameter, and the one next to a point of the diagram.
//
// A place is {piece, a, b, t}: between rows a and b of the piece, at the part t of the way. It is
// exact on straight pieces and at computed points, interpolated elsewhere.
"use strict";

(function (pwscont) {
  const rowOf = (piece, k) => pwscont.data.pieces.rows[pwscont.data.pieces.first[piece] + k];
  const length = (piece) => {
    const first = pwscont.data.pieces.first;
    return first[piece + 1] - first[piece];
  };
  pwscont.rowOf = rowOf;
  pwscont.length = length;

  // Return the value of a column at a place.
  pwscont.at = function (place, column) {
    const a = pwscont.value(place.a, column);
    if (place.t === 0) return a;
    return a + place.t * (pwscont.value(place.b, column) - a);
  };

  // Tell whether values of the parameter are one, but for rounding; as the graph does.
  pwscont.same = function (a, b) {
    const [lo, hi] = pwscont.data.interval;
    return Math.abs(a - b) <= pwscont.data.same * Math.max(Math.abs(b), hi - lo);
  };

  const ends = (piece) => [
    pwscont.value(rowOf(piece, 0), 0),
    pwscont.value(rowOf(piece, length(piece) - 1), 0),
  ];

  // Return the place on a piece at a parameter strictly inside.
  pwscont.placeOn = function (piece, alpha) {
    const [start, end] = ends(piece);
    const rising = end > start;
    let low = 0;
    let high = length(piece) - 1;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (pwscont.value(rowOf(piece, middle), 0) < alpha === rising) low = middle;
      else high = middle;
    }
    const [a, b] = [rowOf(piece, low), rowOf(piece, high)];
    const [from, to] = [pwscont.value(a, 0), pwscont.value(b, 0)];
    return { piece, a, b, t: to === from ? 0 : (alpha - from) / (to - from) };
  };

  function between(piece, alpha) {
    const pieces = pwscont.data.pieces;
    const place = pwscont.placeOn(piece, alpha);
    const told = { kind: "", det: pieces.det[piece], label: pieces.labels[pieces.label[piece]] };
    return { ...place, ...told, branch: pieces.branch[piece], curved: pieces.curved[piece] };
  }

  // Return a special point as a solution.
  pwscont.atPoint = function (point) {
    const piece = pwscont.data.pieces.id.indexOf(point.piece);
    const told = { kind: point.kind, det: point.det, label: point.label, branch: point.branch };
    return { piece, a: point.row, b: point.row, t: 0, ...told, curved: false };
  };

  // Return all solutions at a parameter, by piece, as the graph lists them.
  pwscont.solutions = function (alpha) {
    const { pieces, points } = pwscont.data;
    const found = points
      .filter((point) => point.node >= 0 && pwscont.same(pwscont.value(point.row, 0), alpha))
      .map(pwscont.atPoint);
    for (let piece = 0; piece < pieces.count; piece++) {
      const [start, end] = ends(piece);
      const inside = Math.min(start, end) < alpha && alpha < Math.max(start, end);
      if (inside && !pwscont.same(start, alpha) && !pwscont.same(end, alpha)) {
        found.push(between(piece, alpha));
      }
    }
    return found.sort((one, other) => one.piece - other.piece);
  };

  // Return the number of solutions at a parameter by the graph's own table, and whether it says.
  pwscont.count = function (alpha) {
    const { stretches, between: single } = pwscont.data;
    for (const [at, count] of single) {
      if (pwscont.same(at, alpha)) return count === null ? Infinity : count;
    }
    const holds = (row) =>
      (row.lo < alpha || (row.lo === alpha && row.lo_closed)) &&
      (alpha < row.hi || (row.hi === alpha && row.hi_closed));
    const row = stretches.find(holds);
    return row ? row.count : NaN;
  };

  function toSegment(x, y, x0, y0, x1, y1) {
    const [dx, dy] = [x1 - x0, y1 - y0];
    const square = dx * dx + dy * dy;
    const along = square > 0 ? ((x - x0) * dx + (y - y0) * dy) / square : 0;
    const t = Math.min(1, Math.max(0, along));
    return { t, distance: Math.hypot(x0 + t * dx - x, y0 + t * dy - y) };
  }

  // Return the place on the pieces that are shown next to a point (x, y), and how far it is.
  // `scale` has the pixels for each unit of both axes.
  pwscont.nearest = function (x, y, columns, scale, isShown) {
    let best = null;
    let least = Infinity;
    for (let piece = 0; piece < pwscont.data.pieces.count; piece++) {
      if (!isShown(piece)) continue;
      const pixels = (k) => columns.map((c, i) => pwscont.value(rowOf(piece, k), c) * scale[i]);
      for (let k = 1; k < length(piece); k++) {
        const found = toSegment(x * scale[0], y * scale[1], ...pixels(k - 1), ...pixels(k));
        if (found.distance < least) {
          least = found.distance;
          best = { piece, a: rowOf(piece, k - 1), b: rowOf(piece, k), t: found.t };
        }
      }
    }
    return best && { place: best, distance: least };
  };
})(window.pwscont);
