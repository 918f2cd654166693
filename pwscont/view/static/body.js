// The deformed body with contact states, and pressure and shear along its boundary.
"use strict";

(function (pwscont) {
  const STATES = ["no contact", "stick", "slip+", "slip-"];

  // Return so many numbers of a packed array at a place.
  function interpolated(array, size, { rows, weights }) {
    const found = new Float64Array(size);
    rows.forEach((row, k) => {
      for (let i = 0; i < size; i++) found[i] += weights[k] * array[row * size + i];
    });
    return found;
  }

  const rows = () => pwscont.data.rows.length / pwscont.data.names.length;

  function elements(body, x, y, place) {
    const count = body.corners.length;
    const parts = interpolated(body.shade, body.components * count, place);
    const shade = body.corners.map((_, e) => {
      let square = 0;
      for (let m = 0; m < body.components; m++) square += parts[m * count + e] ** 2;
      return Math.sqrt(square);
    });
    const along = (values) => body.corners.map((nodes) => nodes.map((node) => values[node]));
    return { xs: along(x), ys: along(y), shade };
  }

  function contact(body, x, y, states) {
    const some = (wanted) => body.contact.filter((_, i) => wanted.includes(STATES[states[i]]));
    const places = (nodes) => ({ x: nodes.map((n) => x[n]), y: nodes.map((n) => y[n]) });
    const angle = body.contact
      .map((_, i) => {
        const way = STATES[states[i]] === "slip+" ? 1 : -1;
        return Math.atan2(way * body.tangents[i][1], way * body.tangents[i][0]) - Math.PI / 2;
      })
      .filter((_, i) => ["slip+", "slip-"].includes(STATES[states[i]]));
    return {
      stick: places(some(["stick"])),
      "no contact": places(some(["no contact"])),
      slip: { ...places(some(["slip+", "slip-"])), angle },
      held: places(body.held),
    };
  }

  function lines(body, values) {
    const found = { xs: [], ys: [] };
    for (const part of new Set(body.part)) {
      const nodes = body.part.flatMap((other, i) => (other === part ? [i] : []));
      found.xs.push(nodes.map((i) => body.arc[i]));
      found.ys.push(nodes.map((i) => values[i]));
    }
    return found;
  }

  function curves(body, place) {
    const p = body.contact.length;
    const every = interpolated(body.curves, 3 * p, place);
    const [pressure, shear, bound] = [0, 1, 2].map((i) => Array.from(every.slice(i * p, i * p + p)));
    const upper = lines(body, bound);
    const lower = lines(body, bound.map((value) => -value));
    return {
      pressure: lines(body, pressure),
      shear: lines(body, shear),
      bound: { xs: [...upper.xs, ...lower.xs], ys: [...upper.ys, ...lower.ys] },
      "pressure at nodes": { x: body.arc, y: pressure },
      "shear at nodes": { x: body.arc, y: shear },
    };
  }

  // Show the body at a place on a piece.
  pwscont.showBody = function (place) {
    const body = pwscont.data.body;
    if (!body || place.piece < 0) return;
    const size = body.positions.length / rows();
    const moved = interpolated(body.positions, size, place);
    const [x, y] = [moved.slice(0, size / 2), moved.slice(size / 2)];
    pwscont.fill("elements", elements(body, x, y, place));
    const marks = contact(body, x, y, body.states[place.piece]);
    for (const [name, columns] of Object.entries({ ...marks, ...curves(body, place) })) {
      pwscont.fill(name, columns);
    }
  };

  // Draw what does not move, and give the curves the same axes for all solutions.
  pwscont.beginBody = function () {
    const body = pwscont.data.body;
    if (!body) return;
    pwscont.fill("obstacles", { xs: body.obstacles.map((o) => o[0]), ys: body.obstacles.map((o) => o[1]) });
    let [low, high] = [0, 0];
    for (const value of body.curves) {
      low = Math.min(low, value);
      high = Math.max(high, value);
    }
    const curvesFigure = pwscont.find("curves");
    pwscont.setRange(curvesFigure.y_range, low, high);
    pwscont.setRange(curvesFigure.x_range, Math.min(...body.arc), Math.max(...body.arc));
    document.getElementById("body-note").innerHTML =
      '● stick, ○ no contact, <span class="slip">▲</span> slip, pointing where the body has moved, ' +
      `<span class="held">■</span> clamped; ${pwscont.escaped(body.note)}.`;
  };

  // Return how many contact nodes do what, in words.
  pwscont.contactWords = function (piece) {
    const states = pwscont.data.body.states[piece];
    return STATES.map((word, i) => [states.filter((state) => state === i).length, word])
      .filter(([count]) => count)
      .map(([count, word]) => `${count} ${word.replace("-", "\u2212")}`)
      .join(", ");
  };
})(window.pwscont);
