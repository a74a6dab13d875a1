// Curves over time with a cursor, zoom (wheel, buttons) and panning (drag); a double click shows all.
for (const figure of document.querySelectorAll("figure.curves")) {
  const data = JSON.parse(figure.querySelector("script").textContent), t = data.time;
  const canvas = figure.querySelector("canvas"), out = figure.querySelector("output"), pick = figure.querySelector("select");
  const left = 46, right = 8, gap = 26, first = t[0], last = t[t.length - 1];
  let from = first, to = last, at = null, drag = null;
  const css = name => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const colour = { command: () => css("--soft"), measured: () => css("--warn"), simulated: () => css("--accent"),
    error: () => css("--ink") };
  const width = () => canvas.clientWidth - left - right;
  const x = time => left + (time - from) / (to - from) * width();
  const timeAt = px => from + (px - left) / width() * (to - from);
  const row = time => {
    let a = 0, b = t.length - 1;
    while (b - a > 1) { const m = (a + b) >> 1; if (t[m] <= time) a = m; else b = m; }
    return time - t[a] < t[b] - time ? a : b;
  };
  function panel(pen, curves, top, height) {
    const a = Math.max(row(from) - 1, 0), b = Math.min(row(to) + 1, t.length - 1);
    let low = Infinity, high = -Infinity;
    for (const values of Object.values(curves)) for (let i = a; i <= b; i++)
      if (values[i] !== null) { low = Math.min(low, values[i]); high = Math.max(high, values[i]); }
    if (!(high >= low)) { low = -1; high = 1; }
    const room = Math.max((high - low) * 0.06, 0.05);
    low -= room; high += room;
    const y = value => top + height - (value - low) / (high - low) * height;
    const step = [1, 2, 5, 10].map(k => k * 10 ** Math.floor(Math.log10((high - low) / 3))).find(k => (high - low) / k < 5) || 1;
    pen.strokeStyle = css("--line"); pen.fillStyle = css("--soft"); pen.lineWidth = 1; pen.textAlign = "right";
    for (let v = Math.ceil(low / step) * step; v <= high; v += step) {
      pen.beginPath(); pen.moveTo(left, y(v)); pen.lineTo(left + width(), y(v)); pen.stroke();
      pen.fillText(String(+v.toFixed(6)), left - 6, y(v) + 4);
    }
    pen.save(); pen.beginPath(); pen.rect(left, top - 2, width(), height + 4); pen.clip();
    for (const [name, values] of Object.entries(curves)) {
      pen.strokeStyle = colour[name](); pen.lineWidth = name === "command" ? 1 : 1.6; pen.beginPath();
      let open = false;
      for (let i = a; i <= b; i++) {
        if (values[i] === null) { open = false; continue; }
        if (open) pen.lineTo(x(t[i]), y(values[i])); else pen.moveTo(x(t[i]), y(values[i]));
        open = true;
      }
      pen.stroke();
    }
    pen.restore();
  }
  function draw() {
    const scale = window.devicePixelRatio || 1, w = canvas.clientWidth, h = canvas.clientHeight;
    canvas.width = w * scale; canvas.height = h * scale;
    const pen = canvas.getContext("2d");
    pen.scale(scale, scale); pen.font = "12px sans-serif";
    const curves = data.joints[pick.value], error = data.errors[pick.value], low = (h - 2 * gap - 10) * 0.3;
    panel(pen, curves, 10, h - 2 * gap - 10 - low);
    panel(pen, { error }, h - gap - low, low);
    pen.fillStyle = css("--soft"); pen.textAlign = "left"; pen.fillText("error [deg]", left + 4, h - gap - low - 6);
    pen.textAlign = "center";
    const step = [1, 2, 5, 10].map(k => k * 10 ** Math.floor(Math.log10((to - from) / 4))).find(k => (to - from) / k < 8) || 1;
    for (let v = Math.ceil(from / step) * step; v <= to; v += step) pen.fillText(`${+v.toFixed(6)} s`, x(v), h - 8);
    if (at === null) { out.textContent = "Move over the curves to read them; wheel or buttons zoom, drag moves, double click shows all."; return; }
    pen.strokeStyle = css("--rule"); pen.beginPath(); pen.moveTo(x(t[at]), 6); pen.lineTo(x(t[at]), h - gap); pen.stroke();
    const said = Object.entries({ ...curves, error }).map(([name, v]) => `${name} ${v[at] === null ? "–" : v[at].toFixed(2)}`);
    out.textContent = `${t[at].toFixed(3)} s: ${said.join(", ")} deg`;
  }
  function zoom(factor, about) {
    const span = Math.min(Math.max((to - from) * factor, 0.05), last - first);
    from = Math.min(Math.max(about - (about - from) / (to - from) * span, first), last - span);
    to = from + span;
    draw();
  }
  canvas.addEventListener("pointermove", event => {
    const px = event.offsetX;
    if (drag !== null) {
      const by = Math.min(Math.max((drag - px) / width() * (to - from), first - from), last - to);
      from += by; to += by; drag = px;
    }
    at = row(Math.min(Math.max(timeAt(px), from), to));
    draw();
  });
  canvas.addEventListener("pointerdown", event => { drag = event.offsetX; canvas.setPointerCapture(event.pointerId); });
  canvas.addEventListener("pointerup", () => { drag = null; });
  canvas.addEventListener("pointerleave", () => { at = null; draw(); });
  canvas.addEventListener("dblclick", () => { from = first; to = last; draw(); });
  canvas.addEventListener("wheel", event => {
    event.preventDefault();
    zoom(event.deltaY > 0 ? 1.25 : 0.8, timeAt(event.offsetX));
  }, { passive: false });
  figure.querySelector("[data-do=in]").addEventListener("click", () => zoom(0.5, (from + to) / 2));
  figure.querySelector("[data-do=out]").addEventListener("click", () => zoom(2, (from + to) / 2));
  figure.querySelector("[data-do=all]").addEventListener("click", () => { from = first; to = last; draw(); });
  pick.addEventListener("change", draw);
  new ResizeObserver(draw).observe(canvas);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
}
