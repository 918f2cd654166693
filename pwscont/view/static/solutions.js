// The solutions at a value of the parameter, and the one next to a point of the diagram.
//
// A place is {piece, rows, weights}: the sum of some rows of a piece, each with its weight. It is
// exact on straight pieces and at computed points, interpolated elsewhere. What two interpolations
// by fewer rows, its `others`, differ by is how far it may be off.
"use strict";

(function (pwscont) {
  const WINDOW = 4; // rows that a solution is interpolated from
  const [EPS, HALVES] = [1e-15, 60];
  const rowOf = (piece, k) => pwscont.data.pieces.rows[pwscont.data.pieces.first[piece] + k];
  const length = (piece) => {
    const first = pwscont.data.pieces.first;
    return first[piece + 1] - first[piece];
  };
  pwscont.rowOf = rowOf;
  pwscont.length = length;

  // Return the value of a column at a place.
  pwscont.at = function ({ rows, weights }, column) {
    if (rows.length === 1) return pwscont.value(rows[0], column);
    return rows.reduce((sum, row, i) => sum + weights[i] * pwscont.value(row, column), 0);
  };

  // Tell whether the value of a column at a place is that of the graph.
  pwscont.isExact = ({ piece, rows, curved }, column) =>
    rows.length === 1 || (!curved && (column <= pwscont.data.unknowns || length(piece) === 2));

  // Return how far an interpolated value may be off.
  pwscont.doubt = function ({ others }, column) {
    const rough = pwscont.data.rough[column];
    if (!others) return rough;
    return Math.max(rough, Math.abs(pwscont.at(others[0], column) - pwscont.at(others[1], column)));
  };

  pwscont.onRow = (row) => ({ rows: [row], weights: [1] });
  const onChord = (a, b, t) => ({ rows: [a, b], weights: [1 - t, t] });

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
    const first = Math.max(0, Math.min(low - 1, length(piece) - WINDOW));
    const window = Array.from({ length: Math.min(WINDOW, length(piece)) }, (_, i) => first + i);
    const others = [window.slice(0, -1), window.slice(1)];
    const place = { piece, ...interpolated(piece, window, low, alpha) };
    if (window.length === 2) return place;
    return { ...place, others: others.map((some) => interpolated(piece, some, low, alpha)) };
  };

  // Return the place at a parameter between rows k and k + 1 on the polynomial through some rows.
  // Its variable is the length along the piece: near a fold alpha is no good variable.
  function interpolated(piece, window, k, alpha) {
    const along = (i) => pwscont.data.pieces.along[pwscont.data.pieces.first[piece] + i];
    const rows = window.map((i) => rowOf(piece, i));
    const nodes = window.map(along);
    const at = (s) => ({ rows, weights: lagrange(nodes, s) });
    return at(root((s) => pwscont.at(at(s), 0) - alpha, along(k), along(k + 1)));
  }

  function lagrange(nodes, s) {
    const factor = (own, other) => (own === other ? 1 : (s - other) / (own - other));
    return nodes.map((own) => nodes.reduce((product, other) => product * factor(own, other), 1));
  }

  // Return where a function is zero: by the secant, which is exact on straight lines, or bisection.
  function root(f, low, high) {
    const [from, to] = [f(low), f(high)];
    const secant = low - (from * (high - low)) / (to - from);
    if (!(secant > low && secant < high)) return Math.abs(from) <= Math.abs(to) ? low : high;
    if (Math.abs(f(secant)) <= EPS * Math.abs(to - from)) return secant;
    for (let i = 0; i < HALVES; i++) {
      const middle = 0.5 * (low + high);
      if (f(middle) < 0 === from < 0) low = middle;
      else high = middle;
    }
    return low;
  }

  function between(piece, alpha) {
    const pieces = pwscont.data.pieces;
    const place = pwscont.placeOn(piece, alpha);
    const told = { kind: "", det: pieces.det[piece], label: pieces.labels[pieces.label[piece]] };
    return { ...place, ...told, branch: pieces.branch[piece], curved: pieces.curved[piece] };
  }

  // Return the branches that share a piece: one, but of evolutions there may be several.
  pwscont.owners = function (piece) {
    const { owners, branch } = pwscont.data.pieces;
    return owners ? owners[piece] : [branch[piece]];
  };

  // Return the name of a branch, and of all branches that a solution belongs to.
  pwscont.branchName = function (branch) {
    const { noun, others, branches } = pwscont.data;
    return others && branch === branches - 1 ? `more ${noun}s` : `${noun || "branch"} ${branch + 1}`;
  };
  pwscont.whose = ({ piece, branch }) =>
    (piece >= 0 ? pwscont.owners(piece) : [branch]).map(pwscont.branchName).join(", ");

  // Return a special point as a solution.
  pwscont.atPoint = function (point) {
    const piece = pwscont.data.pieces.id.indexOf(point.piece);
    const told = { kind: point.kind, det: point.det, label: point.label, branch: point.branch };
    return { piece, ...pwscont.onRow(point.row), ...told, curved: false };
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
      if (!isShown(piece) || (pwscont.data.pieces.jump && pwscont.data.pieces.jump[piece])) continue;
      const pixels = (k) => columns.map((c, i) => pwscont.value(rowOf(piece, k), c) * scale[i]);
      for (let k = 1; k < length(piece); k++) {
        const found = toSegment(x * scale[0], y * scale[1], ...pixels(k - 1), ...pixels(k));
        if (found.distance < least) {
          least = found.distance;
          best = { piece, ...onChord(rowOf(piece, k - 1), rowOf(piece, k), found.t) };
        }
      }
    }
    return best && { place: best, distance: least };
  };
})(window.pwscont);
