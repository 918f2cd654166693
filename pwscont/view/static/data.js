// The records of the page, and numbers as they are written. Everything hangs on one name.
"use strict";
window.pwscont = {};

(function (pwscont) {
  const ARRAYS = { Float64Array, Float32Array, Int32Array };
  // Digits of what is exact; what is smaller than a part of the largest value is rounding.
  const DIGITS = 6;
  const DUST = 1e-12;

  function unpack(packed) {
    const bytes = Uint8Array.from(atob(packed.bytes), (letter) => letter.charCodeAt(0));
    return new ARRAYS[packed.type](bytes.buffer);
  }

  // Read the records; packed arrays become typed arrays.
  pwscont.read = function () {
    const data = JSON.parse(document.getElementById("records").textContent);
    data.rows = unpack(data.rows);
    data.pieces.rows = unpack(data.pieces.rows);
    data.pieces.count = data.pieces.id.length;
    if (data.body) {
      for (const name of ["positions", "shade", "curves"]) {
        data.body[name] = unpack(data.body[name]);
      }
    }
    pwscont.data = data;
  };

  pwscont.value = (row, column) => pwscont.data.rows[row * pwscont.data.names.length + column];

  function written(value, digits) {
    if (!Number.isFinite(value)) return "not known";
    return String(Number(value.toPrecision(digits))).replaceAll("-", "\u2212");
  }

  pwscont.number = (value) => written(value, DIGITS);

  // Return a value of a solution as it is written; one on a curved piece is interpolated.
  pwscont.valueOf = function (solution, column) {
    const size = Math.max(...pwscont.data.names.map((_, i) => Math.abs(pwscont.at(solution, i)) || 0));
    const value = pwscont.at(solution, column);
    const clean = Math.abs(value) <= DUST * size ? 0 : value;
    const isExact = !solution.curved || column === 0 || clean === 0;
    return isExact ? written(clean, DIGITS) : `\u2248 ${written(clean, pwscont.data.digits)}`;
  };

  pwscont.sign = (det) => (det > 0 ? "+" : det < 0 ? "\u2212" : "") + Math.abs(det);

  const GREEK = { alpha: "α", phi: "φ" };
  pwscont.symbol = (name) => GREEK[name] || name;

  pwscont.escaped = function (words) {
    const letters = { "&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;", "'": "&#39;" };
    return words.replace(/[&<>"']/g, (letter) => letters[letter]);
  };

  pwscont.kind = (word) => word.replace("nonsmooth", "non-smooth");

  pwscont.plural = (count, noun) => `${count} ${noun}${count === 1 ? "" : "s"}`;
})(window.pwscont);
