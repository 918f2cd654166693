// The page: what the user chooses, and what is listed then.
"use strict";

(function (pwscont) {
  const NEAR = [25, 9]; // pixels from a click to a line, to a special point
  const MOST = 60; // solutions that are listed
  const MANY = 24; // names, of which one wants to find some
  const { state, element, color, style, parameter } = pwscont.diagram;
  const { isShown, shownPoints } = pwscont.diagram;
  const { drawAxes, drawCounts, drawDiagram, drawNow, inStep } = pwscont.diagram;

  // -- solutions ---------------------------------------------------------------------------------

  function countWords() {
    const count = pwscont.count(state.alpha);
    const at = `at ${parameter()} = ${pwscont.alpha(state.alpha)}`;
    if (count === Infinity) return `Infinitely many solutions ${at}; the ends of the vertical piece:`;
    const known = Number.isNaN(count) ? state.listed.length : count;
    const least = pwscont.data.complete ? "" : "At least ";
    if (known === 0) return `No solution ${least && "found "}${at}`;
    return `${least}${pwscont.plural(known, "solution")} ${at}`;
  }

  const modeOf = (place) =>
    pwscont.data.body && place.piece >= 0 ? pwscont.contactWords(place.piece) : place.label;

  function entry(solution, i) {
    const button = document.createElement("button");
    const isChosen = state.chosen && isSame(solution, state.chosen);
    button.setAttribute("aria-pressed", String(Boolean(isChosen)));
    const value = pwscont.valueOf(solution, state.y);
    const kind = solution.kind && !["start", "end", "transition"].includes(solution.kind);
    const what = `${i + 1}. ${kind ? `${pwscont.kind(solution.kind)}, ` : ""}${modeOf(solution)}`;
    button.innerHTML =
      `<span class="swatch" style="background: ${color(solution.branch)}"></span>` +
      `<span class="what"></span><span class="number">${pwscont.escaped(value)}</span>` +
      (pwscont.data.noun ? "" : `<span class="number">det ${pwscont.sign(solution.det)}</span>`);
    button.querySelector(".what").textContent = what;
    button.title = `${pwscont.whose(solution)}: ${solution.label}`;
    button.addEventListener("click", () => choose(solution));
    const item = document.createElement("li");
    item.append(button);
    return item;
  }

  const isSame = (one, other) =>
    one.piece === other.piece && `${one.rows}` === `${other.rows}` && `${one.weights}` === `${other.weights}`;

  function list() {
    element("count").textContent = countWords();
    const items = state.listed.slice(0, MOST).map(entry);
    element("list").replaceChildren(...items);
    const more = state.listed.length - MOST;
    if (more > 0) element("list").append(`and ${more} more`);
  }

  function table() {
    const { names, left_out: left } = pwscont.data;
    const wanted = element("find").value.trim().toLowerCase();
    const rows = names.flatMap((name, column) => {
      if (wanted && !name.toLowerCase().includes(wanted)) return [];
      const value = pwscont.valueOf(state.chosen, column);
      const word = pwscont.escaped(pwscont.symbol(name)).replace(/^([^_\s]+)_(\S+)/, "$1<sub>$2</sub>");
      return [`<tr><td>${word}</td><td>${value}</td></tr>`];
    });
    element("table").innerHTML = rows.join("");
    element("left-out").textContent = left
      ? `${pwscont.plural(left, "unknown")} more had no room in this file.`
      : "";
  }

  function showChosen() {
    const { chosen, listed } = state;
    element("values").hidden = !chosen;
    if (!chosen) {
      element("heading").textContent = "";
      element("mode").textContent = "";
      return;
    }
    const place = listed.findIndex((solution) => isSame(solution, chosen));
    const number = place >= 0 ? `Solution ${place + 1}` : "A solution on a vertical piece";
    const piece = chosen.piece >= 0 ? `, piece ${pwscont.data.pieces.id[chosen.piece]}` : "";
    const kind = chosen.kind ? `, ${pwscont.kind(chosen.kind)}` : "";
    const sign = pwscont.data.noun ? "" : `, det ${pwscont.sign(chosen.det)}`;
    element("heading").textContent = `${number}: ${pwscont.whose(chosen)}${piece}${kind}${sign}`;
    element("mode").textContent = modeOf(chosen);
    element("mode").title = chosen.label;
    pwscont.showBody(chosen);
    if (element("values").open) table();
  }

  function show() {
    list();
    showChosen();
    drawNow();
  }

  function choose(solution) {
    state.chosen = solution;
    show();
  }

  // Return the solution to show next: of the same piece, else the closest of the branch.
  function successor(before) {
    if (!before) return state.listed[0] || null;
    const piece = state.listed.find((solution) => solution.piece === before.piece);
    if (piece) return piece;
    const branch = state.listed.filter((solution) => solution.branch === before.branch);
    const value = pwscont.at(before, state.y);
    const off = (solution) => Math.abs(pwscont.at(solution, state.y) - value);
    const closest = branch.sort((one, other) => off(one) - off(other))[0];
    return closest || state.listed[0] || null;
  }

  function setAlpha(alpha) {
    const [lo, hi] = pwscont.data.interval;
    state.alpha = pwscont.same(alpha, 0) ? 0 : Math.min(hi, Math.max(lo, alpha));
    state.listed = pwscont.solutions(state.alpha);
    const slide = element("slide");
    slide.value = String(Math.round((Number(slide.max) * (state.alpha - lo)) / (hi - lo)));
    element("alpha").value = String(pwscont.chosen(state.alpha));
  }

  // Go to a value of the parameter.
  pwscont.move = function (alpha) {
    setAlpha(alpha);
    choose(successor(state.chosen));
  };

  // Show the solution next to a click at (x, y) of the diagram.
  pwscont.tapped = function (x, y) {
    const diagram = pwscont.find("diagram");
    const scale = [
      diagram.inner_width / (diagram.x_range.end - diagram.x_range.start),
      diagram.inner_height / (diagram.y_range.end - diagram.y_range.start),
    ];
    const found = pwscont.nearest(x, y, [state.x, state.y], scale, isShown);
    if (!found || found.distance > NEAR[0]) return;
    const off = (point) =>
      Math.hypot(
        (pwscont.value(point.row, state.x) - x) * scale[0],
        (pwscont.value(point.row, state.y) - y) * scale[1],
      );
    const nodes = shownPoints().filter((point) => point.node >= 0);
    const node = nodes.sort((one, other) => off(one) - off(other))[0];
    if (node && off(node) <= NEAR[1]) {
      goTo(pwscont.atPoint(node));
    } else {
      onPiece(found.place);
    }
  };

  function onPiece(place) {
    const { pieces } = pwscont.data;
    const { piece } = place;
    if (!pieces.vertical[piece]) place = rounded(place);
    const told = { branch: pieces.branch[piece], label: pieces.labels[pieces.label[piece]] };
    goTo({ ...place, ...told, kind: "", det: pieces.det[piece], curved: pieces.curved[piece] });
  }

  // Move a place on a piece to a parameter with as few digits as the picture shows.
  function rounded(place) {
    const [lo, hi] = pwscont.data.interval;
    const range = pwscont.find("diagram").x_range;
    const width = state.x === 0 ? Math.abs(range.end - range.start) : hi - lo;
    const digits = Math.min(100, Math.max(0, 3 - Math.floor(Math.log10(width))));
    const alpha = Number(pwscont.at(place, 0).toFixed(digits));
    const on = pwscont.placeOn(place.piece, alpha);
    return pwscont.same(pwscont.at(on, 0), alpha) ? on : place;
  }

  function goTo(solution) {
    setAlpha(pwscont.at(solution, 0));
    const { vertical } = pwscont.data.pieces;
    const listed = state.listed.find((other) => other.piece === solution.piece);
    const sameRow = state.listed.find((other) => solution.rows.length === 1 && `${other.rows}` === `${solution.rows}`);
    choose(vertical[solution.piece] ? solution : sameRow || listed || solution);
  }

  // -- controls and legends ----------------------------------------------------------------------

  function options(id, words, chosen, change) {
    const select = element(id);
    select.replaceChildren(...words.map((word, i) => new Option(word, String(i), false, i === chosen)));
    select.addEventListener("change", () => change(Number(select.value)));
  }

  const line = (stroke, dash, width) =>
    `<svg width="34" height="10"><line x1="1" x2="33" y1="5" y2="5" stroke="${stroke}" ` +
    `stroke-width="${width}" stroke-dasharray="${dash.join(" ")}"/></svg>`;

  function legend(id, words, pictures) {
    const hidden = state.hidden[id];
    const entries = words.map((word, i) => {
      const label = document.createElement("label");
      label.className = "entry";
      label.title = word;
      label.innerHTML = `<input type="checkbox"${hidden.has(i) ? "" : " checked"}>${pictures[i]}<span></span>`;
      label.querySelector("span").textContent = word;
      label.querySelector("input").addEventListener("change", (event) => {
        if (event.target.checked) hidden.delete(i);
        else hidden.add(i);
        drawDiagram();
      });
      return label;
    });
    element(id).replaceChildren(...entries);
    if (words.length > 2) element(id).prepend(allOrNone(id, words, pictures));
  }

  function allOrNone(id, words, pictures) {
    const button = document.createElement("button");
    button.className = "all";
    button.type = "button";
    button.textContent = "all / none";
    button.addEventListener("click", () => {
      const hidden = state.hidden[id];
      if (hidden.size) hidden.clear();
      else words.forEach((_, i) => hidden.add(i));
      legend(id, words, pictures);
      drawDiagram();
    });
    return button;
  }

  function legends() {
    const branches = Array.from({ length: pwscont.data.branches }, (_, i) => i);
    legend("branches", branches.map(pwscont.branchName), branches.map((i) => line(color(i), [], 5)));
    modeLegend();
    const kinds = Object.entries(pwscont.data.marks).filter(([kind]) =>
      pwscont.data.points.some((point) => point.shown && point.kind === kind),
    );
    element("kinds").innerHTML = kinds.map(([kind, look]) => kindEntry(kind, look)).join("");
  }

  function modeLegend() {
    const { words, dashes } = style();
    legend("modes", words, dashes.map((dash) => line("#000", dash, 2)));
    const isCrowded = new Set(dashes.map(String)).size < words.length;
    element("crowded").textContent = isCrowded ? "There are more modes than line styles: all are solid." : "";
  }

  const SHAPES = {
    circle: '<circle cx="8" cy="7" r="4"/>',
    dot: '<circle cx="8" cy="7" r="2"/>',
    diamond: '<path d="M8 1 12 7 8 13 4 7Z"/>',
    plus: '<path d="M8 2V12M3 7H13"/>',
    square: '<path d="M4 3H12V11H4Z"/>',
    triangle: '<path d="M8 2 13 11H3Z"/>',
    inverted_triangle: '<path d="M8 12 13 3H3Z"/>',
    asterisk: '<path d="M8 1V13M3 4 13 10M3 10 13 4"/>',
    star: '<path d="M8 1 9.8 5.2 14 5.4 10.7 8.2 11.8 12.6 8 10 4.2 12.6 5.3 8.2 2 5.4 6.2 5.2Z"/>',
    x: '<path d="M4 3 12 11M4 11 12 3"/>',
  };

  function kindEntry(kind, look) {
    const shape = (look.lined && SHAPES[look.marker]) || SHAPES.dot;
    const fill = look.hollow ? "#fff" : "#000";
    const picture = `<svg width="16" height="14" stroke="#000" stroke-width="1.5" fill="${fill}">${shape}</svg>`;
    return `<div class="entry">${picture}<span>${pwscont.escaped(pwscont.kind(kind))}</span></div>`;
  }

  function controls() {
    const { names, styles } = pwscont.data;
    const words = names.map(pwscont.symbol);
    options("vertical", words, state.y, (column) => setAxis("y", column));
    options("horizontal", words, state.x, (column) => setAxis("x", column));
    options("style", styles.map((some) => some.title), 0, (i) => {
      state.style = i;
      state.hidden.modes.clear();
      modeLegend();
      drawDiagram();
    });
    element("style").parentElement.hidden = styles.length < 2;
    element("find").hidden = names.length <= MANY;
    element("find").addEventListener("input", table);
    element("values").addEventListener("toggle", () => state.chosen && table());
  }

  function setAxis(axis, column) {
    state[axis] = column;
    drawAxes();
    drawDiagram();
    list();
  }

  function slider() {
    const [lo, hi] = pwscont.data.interval;
    element("parameter").textContent = parameter();
    const [slide, exact] = [element("slide"), element("alpha")];
    slide.addEventListener("input", () => pwscont.move(onStep(Number(slide.value))));
    exact.addEventListener("change", () => {
      const wanted = exact.valueAsNumber;
      pwscont.move(Number.isFinite(wanted) ? wanted : state.alpha);
    });
    [exact.min, exact.max] = [String(lo), String(hi)];
  }

  // Return the parameter at a step of the slider, without the dust of its digits.
  function onStep(step) {
    const [lo, hi] = pwscont.data.interval;
    const part = step / Number(element("slide").max);
    return part === 1 ? hi : part === 0 ? lo : pwscont.chosen(lo + part * (hi - lo));
  }

  function notes() {
    const { guarantee, searched, pieces, names, unknowns, noun } = pwscont.data;
    element("thin").hidden = Boolean(noun);
    if (noun) element("branch-legend").textContent = `${noun[0].toUpperCase()}${noun.slice(1)}s`;
    element("guarantee").textContent = `Guarantee: ${guarantee}. Searched: ${searched}.`;
    const said = [];
    if (pieces.curved.some(Boolean) || names.length > 1 + unknowns) {
      said.push("\u2248: interpolated between points along a piece; the graph itself gives all digits.");
    }
    element("notes").textContent = said.join(" ");
  }

  // Return a step of the slider in the middle of a stretch, or the middle of a short one.
  function middleOf({ lo, hi }) {
    setAlpha(0.5 * (lo + hi));
    const step = onStep(Number(element("slide").value));
    return lo < step && step < hi ? step : 0.5 * (lo + hi);
  }

  // Begin, once Bokeh has drawn its diagrams.
  pwscont.begin = function (shown) {
    pwscont.read();
    pwscont.models = new Map([...shown._all_models.values()].filter((m) => m.name).map((m) => [m.name, m]));
    const { names, what, interval, stretches } = pwscont.data;
    Object.assign(state, { x: 0, y: names.indexOf(what), style: 0, listed: [] });
    controls();
    slider();
    notes();
    legends();
    drawAxes();
    drawCounts();
    inStep();
    pwscont.beginBody();
    const most = stretches.reduce((best, row) => (row.count > best.count ? row : best), {
      lo: interval[0],
      hi: interval[1],
      count: 0,
    });
    pwscont.move(middleOf(most));
    drawDiagram();
    pwscont.isReady = true;
  };
})(window.pwscont);
