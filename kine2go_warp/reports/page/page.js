"use strict";
// Sorts the tables that may be sorted: first upwards, then downwards. Rows without a value always come last.
for (const table of document.querySelectorAll("table.sortable")) {
  const headings = [...table.tHead.rows[0].cells];
  headings.forEach((heading, column) => {
    heading.querySelector("button").addEventListener("click", () => {
      const direction = heading.getAttribute("aria-sort") === "ascending" ? "descending" : "ascending";
      headings.forEach((one) => one.removeAttribute("aria-sort"));
      heading.setAttribute("aria-sort", direction);
      const isNumber = heading.classList.contains("number");
      const sign = direction === "ascending" ? 1 : -1;
      const valueOf = (row) => row.cells[column].dataset.value;
      const rows = [...table.tBodies[0].rows].sort((first, second) => {
        const [a, b] = [valueOf(first), valueOf(second)];
        if (a === undefined || b === undefined) return (a === undefined) - (b === undefined);
        return sign * (isNumber ? a - b : a.localeCompare(b));
      });
      table.tBodies[0].append(...rows);
    });
  });
}

// The pictures of the index are those of the motions, so that each is in the page once.
for (const thumb of document.querySelectorAll(".thumb")) {
  const shots = document.getElementById(thumb.dataset.from).querySelectorAll("img");
  if (shots.length) thumb.style.backgroundImage = `url("${shots[Math.floor(shots.length / 2)].src}")`;
  else thumb.remove();
}

// Shows the motions whose names hold a text and, if that is wanted, which came close to a limit.
const [text, doubtful, found] = ["filter", "doubtful", "found"].map((name) => document.getElementById(name));
const cards = [...document.querySelectorAll(".cards > li")];
function filter() {
  const wanted = new Set(
    cards
      .filter((card) => card.dataset.motion.toLowerCase().includes(text.value.trim().toLowerCase()))
      .filter((card) => !doubtful.checked || ["close", "over"].includes(card.dataset.mark))
      .map((card) => card.dataset.motion),
  );
  for (const one of document.querySelectorAll("[data-motion]")) one.hidden = !wanted.has(one.dataset.motion);
  for (const row of document.querySelectorAll("table.sortable tbody tr")) row.hidden = !wanted.has(row.cells[0].textContent);
  found.textContent = `${wanted.size} of ${cards.length} motions`;
}
text.addEventListener("input", filter);
doubtful.addEventListener("change", filter);
document.querySelector(".filter").hidden = cards.length < 2;

// A link to a motion unfolds it.
function unfold() {
  const part = document.getElementById(decodeURIComponent(location.hash.slice(1)));
  const folded = part && part.querySelector("details.motion");
  if (!folded) return;
  folded.open = true;
  part.scrollIntoView();
}
addEventListener("hashchange", unfold);
unfold();

// A film of the legs from the right: the reference behind in green, the far legs lighter, marks on the ground.
const numbers = (text) => new Int16Array(Uint8Array.from(atob(text), (one) => one.charCodeAt(0)).buffer);
const [WIDTH, HEIGHT, SCALE, FLOOR] = [640, 240, 0.36, 210];
const PER_ROBOT = 32;
function drawRobot(pen, points, start, colour) {
  const place = (leg, joint) => {
    const at = start + 8 * leg + 2 * joint;
    return [WIDTH / 2 + SCALE * points[at], FLOOR - SCALE * points[at + 1]];
  };
  const line = (places, width, alpha) => {
    pen.globalAlpha = alpha;
    pen.lineWidth = width;
    pen.beginPath();
    places.forEach(([x, y], index) => (index ? pen.lineTo(x, y) : pen.moveTo(x, y)));
    pen.stroke();
  };
  pen.strokeStyle = colour;
  pen.lineCap = pen.lineJoin = "round";
  // Legs are FL, FR, RL, RR: the left ones are far.
  for (const leg of [0, 2]) line([0, 1, 2, 3].map((joint) => place(leg, joint)), 4, 0.35);
  line([place(1, 0), place(3, 0)], 16, 0.8);
  for (const leg of [1, 3]) line([0, 1, 2, 3].map((joint) => place(leg, joint)), 5, 0.9);
  pen.globalAlpha = 1;
}
function play(button) {
  const [points, ground] = [numbers(button.dataset.points), numbers(button.dataset.ground)];
  const [rate, ticks] = [Number(button.dataset.rate), Number(button.dataset.ticks)];
  const shots = button.closest("figure").querySelector(".shots");
  const canvas = Object.assign(document.createElement("canvas"), { width: WIDTH, height: HEIGHT, className: "film" });
  canvas.setAttribute("role", "img");
  canvas.setAttribute("aria-label", button.getAttribute("aria-label"));
  shots.hidden = true;
  shots.before(canvas);
  button.textContent = "Stop";
  const pen = canvas.getContext("2d");
  const ink = getComputedStyle(canvas).color;
  const began = performance.now();
  const draw = (now) => {
    if (!canvas.isConnected) return;
    const picture = Math.floor((Math.max(now - began, 0) / 1000) * rate) % ground.length;
    pen.clearRect(0, 0, WIDTH, HEIGHT);
    pen.strokeStyle = pen.fillStyle = ink;
    pen.font = "16px sans-serif";
    pen.lineWidth = 1;
    pen.beginPath();
    pen.moveTo(0, FLOOR);
    pen.lineTo(WIDTH, FLOOR);
    const half = WIDTH / 2 / SCALE;
    for (let at = -ground[picture] - ticks * Math.ceil(half / ticks); at < half; at += ticks) {
      pen.moveTo(WIDTH / 2 + SCALE * at, FLOOR);
      pen.lineTo(WIDTH / 2 + SCALE * at, FLOOR + 6);
    }
    pen.stroke();
    pen.fillText(`${(picture / rate).toFixed(2)} s`, 8, 20);
    const start = 2 * PER_ROBOT * picture;
    drawRobot(pen, points, start + PER_ROBOT, "#2a9d4f");
    drawRobot(pen, points, start, ink);
    canvas.dataset.picture = picture;
    requestAnimationFrame(draw);
  };
  requestAnimationFrame(draw);
}
for (const button of document.querySelectorAll("button.film"))
  button.addEventListener("click", () => {
    const figure = button.closest("figure");
    const canvas = figure.querySelector("canvas");
    if (!canvas) return play(button);
    canvas.remove();
    figure.querySelector(".shots").hidden = false;
    button.textContent = "Play";
  });
