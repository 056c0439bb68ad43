"use strict";
const SDS = 2.45; // of a Gaussian in two dimensions 95 % lie within so many
const data = JSON.parse(document.getElementById("data").textContent);
const episodes = data.episodes;
const HUE = data.hue;
const last = episodes[0].frames.length - 1;
const nodes = pairs(data.nodes, data.unit_m);
const tracks = data.tracks.map((track) => pairs(track, data.unit_m));
const whole = Math.max(...data.room_m);
const element = (id) => document.getElementById(id);
const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
let period = 0;
let timer = null;

const figure = (value) => (value >= 1000 ? Math.round(value).toLocaleString("en") : String(Number(value.toPrecision(3))));
const percent = (share) => `${Number((100 * Math.max(share, 0)).toPrecision(4))} %`;
const joules = (mj) => (mj >= 1000 ? `${figure(mj / 1000)} J` : `${figure(mj)} mJ`);

function pairs(flat, unit) {
  const points = [];
  for (let i = 0; i < flat.length; i += 2) points.push([flat[i] * unit, flat[i + 1] * unit]);
  return points;
}

// What each node has left after each period, and when it was awake.
for (const episode of episodes) {
  const left = new Float64Array(nodes.length).fill(data.battery_j);
  episode.left = episode.frames.map((frame) => {
    for (const [node, battery] of frame.left_j) left[node] = battery;
    return Float64Array.from(left);
  });
  for (const frame of episode.frames)
    for (const target of frame.targets)
      target.cluster = new Set(target.head < 0 ? target.members : [target.head, ...target.members]);
  episode.least = Math.min(...left) / data.battery_j;
}
const least = Math.min(...episodes.map((episode) => episode.least)); // the emptiest battery of all is the palest
const short = (name) => (name.length > 30 ? `…${name.slice(-29)}` : name);

// --- fields ---

const views = episodes.map((episode, number) => {
  const figure = document.createElement("figure");
  const caption = document.createElement("figcaption");
  const name = document.createElement("b");
  name.textContent = episode.policy;
  const numbers = document.createElement("span"), event = document.createElement("em");
  caption.append(name, event, numbers);
  const canvas = document.createElement("canvas");
  canvas.id = `field${number}`;
  canvas.setAttribute("role", "img");
  canvas.setAttribute("aria-label", `field under ${episode.policy}`);
  figure.append(caption, canvas);
  element("fields").append(figure);
  const view = { episode, canvas, numbers, event, hovered: -1 };
  canvas.addEventListener("pointermove", (event) => hover(view, event));
  canvas.addEventListener("pointerleave", () => { view.hovered = -1; element("tip").hidden = true; draw(); });
  return view;
});

function sized(canvas) {
  const ratio = window.devicePixelRatio || 1;
  const box = canvas.getBoundingClientRect();
  const width = Math.round(box.width * ratio), height = Math.round(box.height * ratio);
  if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, box.width, box.height);
  return [pen, box.width, box.height];
}

function scaleOf(width) {
  const margin = 12, scale = (width - 2 * margin) / whole;
  const up = (whole - data.room_m[1]) / 2, right = (whole - data.room_m[0]) / 2;
  return ([x, y]) => [margin + (x + right) * scale, width - margin - (y + up) * scale];
}

function disc(pen, [x, y], radius, fill, stroke) {
  pen.beginPath();
  pen.arc(x, y, radius, 0, 2 * Math.PI);
  if (fill) { pen.fillStyle = fill; pen.fill(); }
  if (stroke) { pen.strokeStyle = stroke; pen.stroke(); }
}

function line(pen, points, stroke, width, dash = []) {
  pen.beginPath();
  points.forEach(([x, y], i) => (i ? pen.lineTo(x, y) : pen.moveTo(x, y)));
  pen.strokeStyle = stroke;
  pen.lineWidth = width;
  pen.lineJoin = "round";
  pen.setLineDash(dash);
  pen.stroke();
  pen.setLineDash([]);
}

function ellipse(pen, at, [xx, xy, yy], scale) {
  const half = (xx + yy) / 2, off = (xx - yy) / 2, root = Math.hypot(off, xy);
  const [major, minor] = [half + root, half - root].map((variance) => SDS * Math.sqrt(Math.max(variance, 0)) * scale);
  pen.beginPath();
  pen.ellipse(...at, major, minor, -0.5 * Math.atan2(2 * xy, xx - yy), 0, 2 * Math.PI);
  pen.strokeStyle = colour("--ink");
  pen.lineWidth = 1.5;
  pen.stroke();
}

function drawField(view) {
  const { episode } = view;
  const frame = episode.frames[period], left = episode.left[period];
  const [pen, width] = sized(view.canvas);
  const place = scaleOf(width), scale = (width - 24) / whole;
  const [x0, y0] = place([0, data.room_m[1]]);
  if (frame.search) {
    pen.fillStyle = HUE.search + "50";
    pen.fillRect(x0, y0, data.room_m[0] * scale, data.room_m[1] * scale);
  }
  pen.strokeStyle = colour("--line");
  pen.lineWidth = 1;
  pen.strokeRect(x0, y0, data.room_m[0] * scale, data.room_m[1] * scale);
  if (data.radius_m) {
    pen.save();
    pen.beginPath();
    pen.rect(x0, y0, data.room_m[0] * scale, data.room_m[1] * scale);
    pen.clip();
    pen.beginPath();
    for (const node of new Set(frame.targets.flatMap((target) => [...target.cluster]))) {
      const [x, y] = place(nodes[node]);
      pen.moveTo(x, y);
      pen.arc(x, y, data.radius_m * scale, 0, 2 * Math.PI);
    }
    pen.fillStyle = colour("--shade");
    pen.fill();
    pen.restore();
  }
  pen.fillStyle = HUE.cloud + "90";
  for (const target of frame.targets)
    for (const point of pairs(target.cloud, data.coarse_m)) {
      const [x, y] = place(point);
      pen.fillRect(x - 1, y - 1, 2, 2);
    }
  const small = nodes.length > 400 ? 2 : 3;
  pen.lineWidth = 1;
  nodes.forEach((at, node) => {
    if (left[node] > 0) {
      pen.globalAlpha = least < 1 ? (left[node] / data.battery_j - least) / (1 - least) : 1;
      disc(pen, place(at), small, colour("--soft"));
      pen.globalAlpha = 1;
      return disc(pen, place(at), small, null, colour("--soft"));
    }
    const [x, y] = place(at);
    line(pen, [[x - small, y - small], [x + small, y + small]], colour("--soft"), 1);
    line(pen, [[x - small, y + small], [x + small, y - small]], colour("--soft"), 1);
  });
  frame.targets.forEach((target, number) => drawCluster(pen, place, episode, target, number));
  frame.targets.forEach((target, number) => drawTracks(pen, place, scale, episode, target, number));
  if (view.hovered >= 0) { pen.lineWidth = 2; disc(pen, place(nodes[view.hovered]), 9, null, colour("--ink")); }
  const spent = episode.frames.slice(0, period + 1).reduce((sum, f) => sum + f.energy, 0);
  view.numbers.textContent = `error ${frame.error.toFixed(2)} m · ${frame.awake} awake · ${joules(spent)} so far`;
  view.event.textContent = [frame.search && "search", frame.handover && "handover"].filter(Boolean).join(" · ");
}

function drawCluster(pen, place, episode, target, number) {
  const to = { head: nodes[target.head], sink: [data.room_m[0] / 2, data.room_m[1] / 2], target: tracks[number][period] }[data.receiver];
  if (to) for (const node of target.heard) line(pen, [place(nodes[node]), place(to)], HUE.report, 1.5);
  const leads = data.receiver === "head" && target.head >= 0;
  const before = period > 0 ? episode.frames[period - 1].targets[number].head : -1;
  if (leads && target.handover && before >= 0)
    line(pen, [place(nodes[before]), place(nodes[target.head])], HUE.handover, 3);
  pen.lineWidth = 2;
  for (const node of target.detects ?? target.heard) disc(pen, place(nodes[node]), leads && node === target.head ? 10 : 8, null, HUE.report);
  for (const node of target.cluster) disc(pen, place(nodes[node]), 5, HUE.member);
  if (leads) disc(pen, place(nodes[target.head]), 7, HUE.head);
  if (data.receiver === "sink") { const [x, y] = place(to); pen.fillStyle = HUE.head; pen.fillRect(x - 6, y - 6, 12, 12); }
}

function drawTracks(pen, place, scale, episode, target, number) {
  const since = Math.max(0, period - 30), track = tracks[number];
  const at = (mean) => place([mean[0] * data.unit_m, mean[1] * data.unit_m]);
  line(pen, track.slice(since, period + 1).map(place), HUE.target, 2.5);
  line(pen, episode.frames.slice(since, period + 1).map((f) => at(f.targets[number].mean)), colour("--ink"), 1, [3, 3]);
  const [x, y] = at(target.mean);
  ellipse(pen, [x, y], target.cov, scale);
  pen.lineWidth = 3;
  disc(pen, place(track[period]), 5.5, null, HUE.target);
  line(pen, [[x - 6, y], [x + 6, y]], colour("--ink"), 2);
  line(pen, [[x, y - 6], [x, y + 6]], colour("--ink"), 2);
}

function hover(view, event) {
  const box = view.canvas.getBoundingClientRect(), place = scaleOf(box.width);
  const at = [event.clientX - box.left, event.clientY - box.top];
  let best = -1, nearest = 14;
  nodes.forEach((node, k) => {
    const [x, y] = place(node), distance = Math.hypot(x - at[0], y - at[1]);
    if (distance < nearest) { best = k; nearest = distance; }
  });
  view.hovered = best;
  const tip = element("tip");
  tip.hidden = best < 0;
  tip.style.left = `${Math.min(event.clientX + 14, innerWidth - 270)}px`;
  tip.style.top = `${event.clientY + 14}px`;
  draw();
}

function tell(view) {
  const best = view.hovered;
  if (best >= 0) {
    const { frames, left } = view.episode;
    const awake = (k) => frames[k].targets.some((target) => target.cluster.has(best))
      || (frames[k].search && left[k - 1][best] > 0); // a search wakes all
    const periods = [...Array(period + 1).keys()].filter((k) => k > 0 && awake(k));
    const heard = frames.slice(1, period + 1).filter((f) => f.targets.some((target) => target.heard.includes(best))).length;
    const [x, y] = nodes[best];
    element("tip").textContent = `node ${best} at (${x.toFixed(1)}, ${y.toFixed(1)}) m\n`
      + `battery ${(100 * left[period][best] / data.battery_j).toFixed(3)} %\n`
      + `awake in ${periods.length} of ${period} time steps${periods.length ? `, last in ${periods.at(-1)}` : ""}\n`
      + `reported in ${heard}`;
  }
}

// --- curves ---

// Hues stand for what is in the field; policies are told apart by darkness and width.
const stroke = (number) => [colour(number ? "--soft" : "--ink"), number ? 3 : 1.5];

function drawCurve(id, title, unit, large) {
  const canvas = element(id), [pen, width, height] = sized(canvas);
  const box = { left: 52, right: width - 8, top: 20, bottom: height - 18 };
  let values = episodes.map((episode) => episode.frames.slice(1).map((frame) => frame[id]));
  if (large && Math.max(...values.flat()) >= 1000) {
    values = values.map((series) => series.map((value) => value / 1000));
    unit = large;
  }
  const most = Math.max(...values.flat(), 1e-9);
  const at = (k, value) => [box.left + (k / last) * (box.right - box.left),
    box.bottom - (value / most / 1.05) * (box.bottom - box.top)];
  pen.font = "12px system-ui, sans-serif";
  pen.fillStyle = colour("--soft");
  pen.fillText(`${title} [${unit}]`, box.left, 13);
  pen.textAlign = "right";
  for (const share of [0, 0.5, 1]) {
    const y = at(0, share * most)[1];
    line(pen, [[box.left, y], [box.right, y]], colour("--line"), 1);
    pen.fillText(figure(share * most), box.left - 5, y + 4);
  }
  for (const [number, series] of [...values.entries()].reverse()) {
    if (last === 1) disc(pen, at(1, series[0]), 3, stroke(number)[0]);
    line(pen, series.map((value, k) => at(k + 1, value)), ...stroke(number));
  }
  line(pen, [[at(period, 0)[0], box.top], [at(period, 0)[0], box.bottom]], colour("--ink"), 1);
  let right = box.right;
  for (const number of [...episodes.keys()].reverse()) {
    const name = short(episodes[number].policy);
    pen.fillStyle = stroke(number)[0];
    pen.fillText(name, right, 13);
    right -= pen.measureText(name).width + 4;
    line(pen, [[right - 16, 9], [right, 9]], ...stroke(number));
    right -= 28;
  }
  pen.textAlign = "left";
  canvas.onclick = (event) => {
    const share = (event.offsetX - box.left) / (box.right - box.left);
    seek(Math.round(share * last));
  };
}

// --- player ---

function draw() {
  views.forEach(drawField);
  views.forEach(tell);
  drawCurve("error", "error", "m");
  drawCurve("energy", "energy", "mJ", "J");
}

function seek(to) {
  period = Math.min(Math.max(to, 0), last);
  element("slider").value = period;
  element("period").textContent = `step ${period} of ${last}, ${Number((period * data.period_s).toPrecision(6))} s`;
  if (period === last) pause();
  draw();
}

function pause() {
  clearInterval(timer);
  timer = null;
  element("play").textContent = "play";
}

function play() {
  if (timer) return pause();
  if (period === last) seek(0);
  element("play").textContent = "pause";
  timer = setInterval(() => seek(period + 1), 1000 / Number(element("speed").value));
}

function faster(by) {
  const speed = element("speed");
  speed.selectedIndex = Math.min(Math.max(speed.selectedIndex + by, 0), speed.options.length - 1);
  if (timer) { pause(); play(); }
}

const KEYS = { " ": play, ArrowLeft: () => seek(period - 1), ArrowRight: () => seek(period + 1), Home: () => seek(0),
  End: () => seek(last), "+": () => faster(1), "-": () => faster(-1) };
const alone = document.body.classList.contains("replay"); // in a report the page scrolls by these keys, too
(alone ? document : element("player")).addEventListener("keydown", (event) => {
  if (event.target.tagName === "SELECT" || event.ctrlKey || event.altKey || event.metaKey || !(event.key in KEYS)) return;
  event.preventDefault();
  KEYS[event.key]();
});
element("play").onclick = play;
element("first").onclick = () => seek(0);
element("back").onclick = () => seek(period - 1);
element("next").onclick = () => seek(period + 1);
element("last").onclick = () => seek(last);
element("speed").onchange = () => faster(0);
element("slider").max = last;
element("slider").oninput = (event) => seek(Number(event.target.value));
element("about").textContent = `lam = ${data.lam} m/mJ`
  + (data.unscored ? ` · RMS without the first ${data.unscored} time steps` : "") + episodes.map((episode) =>
  ` · ${short(episode.policy)}: RMS ${episode.rms_m.toFixed(3)} m, ${joules(episode.energy_mj)} a time step, return ${episode.total.toFixed(1)}`).join("");
for (const [symbol, word] of data.legend) {
  const entry = document.createElement("span"), mark = document.createElement("i");
  mark.style[["heard", "target"].includes(symbol) ? "borderColor" : "background"] = HUE[symbol];
  entry.append(mark, word);
  element("legend").append(entry);
}
element("legend").append("cross: estimate; ellipse: 95 %; " + (data.radius_m ? "shade: sensing range; " : "") + "grey: asleep" + (least <= 0 ? "; crossed out: dead" : ""));
if (least < 1) {
  const scale = document.createElement("span"), bar = document.createElement("i");
  bar.className = "scale";
  scale.append(`battery ${percent(least)}`, bar, "100 %");
  element("legend").append(scale);
}
new ResizeObserver(draw).observe(document.body);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
seek(Number(location.hash.slice(1)) || 0); // replay.html#60 opens at that time step
