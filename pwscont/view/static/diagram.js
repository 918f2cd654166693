// The branch diagram and the number of solutions: what is drawn of which pieces.
"use strict";

(function (pwscont) {
  const [WIDE, THIN, STRIPE] = [2.6, 1.2, 9]; // pixels
  const state = { alpha: 0, hidden: { branches: new Set(), modes: new Set() }, chosen: null };
  pwscont.state = state;

  const element = (id) => document.getElementById(id);
  const color = (branch) => pwscont.data.colors[branch % pwscont.data.colors.length];

  pwscont.find = (name) => pwscont.models.get(name);
  pwscont.fill = (name, columns) => {
    pwscont.find(name).data = columns;
  };
  // Set what an axis shows, also after a reset, with a margin.
  pwscont.setRange = function (range, low, high) {
    const size = Math.max(Math.abs(low), Math.abs(high)) || 1;
    const half = high - low > 1e-12 * size ? 0.06 * (high - low) : 0.05 * size;
    const [start, end] = [low - half, high + half];
    range.setv({ start, end, reset_start: start, reset_end: end });
  };

  // -- what is shown -----------------------------------------------------------------------------

  const style = () => pwscont.data.styles[state.style];
  const shownOwners = (piece) =>
    pwscont.owners(piece).filter((branch) => !state.hidden.branches.has(branch));
  const isShown = (piece) =>
    shownOwners(piece).length > 0 &&
    !state.hidden.modes.has(style().of[piece]);
  const branchShown = (branch) => !state.hidden.branches.has(branch);

  function continues(before, piece) {
    const { branch, end, start, det } = pwscont.data.pieces;
    const alike = branch[before] === branch[piece] && style().of[before] === style().of[piece];
    return alike && end[before] === start[piece] && det[before] < 0 === det[piece] < 0;
  }

  // Pieces that follow each other in one style are one line: else each would begin with a dash.
  // A piece that several branches share is drawn once for each, in stripes of their colours.
  function drawLines() {
    const { pieces } = pwscont.data;
    const lines = { xs: [], ys: [], color: [], width: [], dash: [], offset: [] };
    let last = -1;
    for (let piece = 0; piece < pieces.count; piece++) {
      if (!isShown(piece)) continue;
      const sharing = shownOwners(piece);
      const joins = last >= 0 && !pieces.owners && continues(last, piece);
      if (!joins) sharing.forEach((branch, i) => beginLine(lines, piece, branch, i, sharing.length));
      for (let i = 0; i < sharing.length; i++) {
        const [xs, ys] = [lines.xs.at(-1 - i), lines.ys.at(-1 - i)];
        for (let k = joins ? 1 : 0; k < pwscont.length(piece); k++) {
          xs.push(pwscont.value(pwscont.rowOf(piece, k), state.x));
          ys.push(pwscont.value(pwscont.rowOf(piece, k), state.y));
        }
      }
      last = piece;
    }
    pwscont.fill("lines", lines);
  }

  function beginLine(lines, piece, branch, i, sharing) {
    const { pieces } = pwscont.data;
    const own = pieces.jump && pieces.jump[piece] ? [2, 4] : style().dashes[style().of[piece]];
    lines.xs.push([]);
    lines.ys.push([]);
    lines.color.push(color(branch));
    lines.width.push(pieces.det[piece] < 0 ? THIN : WIDE);
    lines.dash.push(sharing > 1 ? [STRIPE, (sharing - 1) * STRIPE] : own);
    lines.offset.push(sharing > 1 ? -i * STRIPE : 0);
  }

  const shownPoints = () =>
    pwscont.data.points.filter((point) => point.shown && branchShown(point.branch));

  function words(point) {
    const lines = [`<b>${pwscont.escaped(pwscont.kind(point.kind))}</b>`, ...point.words.map(pwscont.escaped)];
    return `<div style="max-width: 26rem; overflow-wrap: anywhere">${lines.join("<br>")}</div>`;
  }

  function drawMarks() {
    const points = shownPoints();
    const looks = points.map((point) => pwscont.data.marks[point.kind]);
    const colors = points.map((point) => color(point.branch));
    pwscont.fill("marks", {
      x: points.map((point) => pwscont.value(point.row, state.x)),
      y: points.map((point) => pwscont.value(point.row, state.y)),
      color: colors.map((some, i) => (looks[i].lined ? some : null)),
      fill: colors.map((some, i) => (looks[i].hollow ? "#ffffff" : some)),
      marker: looks.map((look) => look.marker),
      size: looks.map((look) => look.size),
      words: points.map(words),
    });
  }

  function drawAxes() {
    const diagram = pwscont.find("diagram");
    for (const [column, range, axis] of [
      [state.x, diagram.x_range, diagram.below[0]],
      [state.y, diagram.y_range, diagram.left[0]],
    ]) {
      let [low, high] = [Infinity, -Infinity];
      for (let row = 0; row < pwscont.data.rows.length / pwscont.data.names.length; row++) {
        const value = pwscont.value(row, column);
        if (value < low) low = value;
        if (value > high) high = value;
      }
      if (Math.max(-low, high) <= pwscont.data.dust[column]) [low, high] = [0, 0];
      if (column === 0) [low, high] = pwscont.data.interval;
      pwscont.setRange(range, ...(low <= high ? [low, high] : [0, 1]));
      axis.axis_label = pwscont.symbol(pwscont.data.names[column]);
    }
  }

  function drawDiagram() {
    drawLines();
    drawMarks();
    drawNow();
  }

  // -- the number of solutions -------------------------------------------------------------------

  function drawCounts() {
    const { stretches, between, breaks, balances, interval } = pwscont.data;
    const steps = { x: [], y: [] };
    for (const { lo, hi, count } of stretches) {
      steps.x.push(lo, hi);
      steps.y.push(count, count);
    }
    const sums = { x: [], y: [] };
    balances.forEach((sum, i) => {
      sums.x.push(breaks[i], breaks[i + 1]);
      sums.y.push(sum, sum);
    });
    const finite = between.filter(([, count]) => count !== null);
    pwscont.fill("count", steps);
    pwscont.fill("balance", sums);
    const size = Math.min(6, Math.max(1, 200 / finite.length)); // many dots would hide the lines
    pwscont.fill("single", {
      x: finite.map(([at]) => at),
      y: finite.map(([, count]) => count),
      size: finite.map(() => size),
    });
    pwscont.fill("endless", { x: verticals() });
    const strip = pwscont.find("strip");
    pwscont.setRange(strip.x_range, ...interval);
    pwscont.setRange(strip.y_range, Math.min(0, ...sums.y), Math.max(1, ...steps.y));
    const endless = verticals().map((at) => `${parameter()} = ${pwscont.alpha(at)}`).join(", ");
    element("verticals").textContent = endless && `Infinitely many solutions, on a vertical piece: ${endless}`;
    const kept = [true, balances.length > 0, Boolean(endless)];
    const legend = pwscont.find("strip legend");
    legend.items = legend.items.filter((_, i) => kept[i]);
    strip.below[0].axis_label = parameter();
  }

  function verticals() {
    const { pieces } = pwscont.data;
    const found = pieces.vertical.flatMap((is, piece) =>
      is ? [pwscont.value(pwscont.rowOf(piece, 0), 0)] : [],
    );
    return [...new Set(found)];
  }

  const parameter = () => pwscont.symbol(pwscont.data.parameter);

  // Keep both horizontal axes in step while the diagram has the parameter across.
  function inStep() {
    const ranges = ["diagram", "strip"].map((name) => pwscont.find(name).x_range);
    for (const [moved, other] of [ranges, [...ranges].reverse()]) {
      const follow = () => {
        if (state.x !== 0 || (moved.start === other.start && moved.end === other.end)) return;
        other.setv({ start: moved.start, end: moved.end });
      };
      moved.properties.start.change.connect(follow);
      moved.properties.end.change.connect(follow);
    }
  }

  function drawNow() {
    const shown = state.listed.filter((solution) => branchShown(solution.branch));
    const values = (places, column) => places.map((place) => pwscont.at(place, column));
    pwscont.fill("now", { x: values(shown, state.x), y: values(shown, state.y) });
    const chosen = state.chosen ? [state.chosen] : [];
    pwscont.fill("chosen", { x: values(chosen, state.x), y: values(chosen, state.y) });
    const rule = pwscont.find("rule");
    rule.dimension = state.y === 0 ? "width" : "height";
    rule.visible = state.x === 0 || state.y === 0;
    rule.location = state.alpha;
    pwscont.find("strip rule").location = state.alpha;
  }

  const drawn = { drawAxes, drawCounts, drawDiagram, drawNow, inStep };
  pwscont.diagram = { state, element, color, style, isShown, shownPoints, parameter, ...drawn };
})(window.pwscont);
