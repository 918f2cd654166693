// The records of the page, and numbers as they are written. Everything hangs on one name.
"use strict";
window.pwscont = {};

(function (pwscont) {
  const ARRAYS = { Float64Array, Float32Array, Int32Array };
  // Digits of what is exact, and of the parameter where it is chosen.
  const [DIGITS, CHOSEN] = [6, 10];

  function unpack(packed) {
    const bytes = Uint8Array.from(atob(packed.bytes), (letter) => letter.charCodeAt(0));
    return new ARRAYS[packed.type](bytes.buffer);
  }

  // Read the records; packed arrays become typed arrays.
  pwscont.read = function () {
    const data = JSON.parse(document.getElementById("records").textContent);
    data.rows = unpack(data.rows);
    data.pieces.rows = unpack(data.pieces.rows);
    data.pieces.along = unpack(data.pieces.along);
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

  // Return so many digits more as it takes to tell the parameters of a short interval apart.
  function furtherDigits() {
    const [lo, hi] = pwscont.data.interval;
    return Math.max(0, Math.ceil(Math.log10(Math.max(Math.abs(lo), Math.abs(hi)) / (hi - lo))));
  }

  const clean = (value, column) => (Math.abs(value) <= pwscont.data.dust[column] ? 0 : value);

  // Return a value of the parameter as it is written, and as it is chosen.
  pwscont.alpha = (value) => written(clean(value, 0), DIGITS + furtherDigits());
  pwscont.chosen = (value) => Number(value.toPrecision(Math.min(17, CHOSEN + furtherDigits())));

  // Return a value of a solution as it is written; what is interpolated has the digits it can have.
  pwscont.valueOf = function (solution, column) {
    const value = clean(pwscont.at(solution, column), column);
    if (column === 0) return pwscont.alpha(value);
    if (pwscont.isExact(solution, column) || value === 0) return written(value, DIGITS);
    if (!Number.isFinite(value)) return written(value, DIGITS);
    return `\u2248 ${interpolated(value, pwscont.doubt(solution, column))}`;
  };

  function interpolated(value, doubt) {
    const certain = Math.floor(Math.log10(Math.abs(value) / doubt));
    return certain < 1 ? "0" : written(value, Math.min(certain, pwscont.data.digits));
  }

  pwscont.sign = (det) => (det > 0 ? "+" : det < 0 ? "\u2212" : "") + Math.abs(det);

  const GREEK = new Map([["alpha", "α"], ["phi", "φ"]]);
  pwscont.symbol = (name) => GREEK.get(name) || name;

  pwscont.escaped = function (words) {
    const letters = { "&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;", "'": "&#39;" };
    return words.replace(/[&<>"']/g, (letter) => letters[letter]);
  };

  pwscont.kind = (word) => word.replace("nonsmooth", "non-smooth");

  pwscont.plural = (count, noun) => `${count} ${noun}${count === 1 ? "" : "s"}`;
})(window.pwscont);
