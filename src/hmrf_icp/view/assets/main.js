// The page: reads the story, and shows what its controls ask for.

const byId = id => document.getElementById(id);
const KINDS = {float32: Float32Array, int32: Int32Array, uint8: Uint8Array, int8: Int8Array};

async function inflated(text) {
  const bytes = Uint8Array.from(atob(text.trim()), c => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Response(stream).arrayBuffer();
}

// The head, with the arrays that it points to in their places.
async function read() {
  const story = JSON.parse(byId("head").textContent), block = await inflated(byId("block").textContent);
  const fill = value => {
    if (value === null || typeof value !== "object") return value;
    if (value.kind in KINDS) return new KINDS[value.kind](block, value.at, value.count);
    for (const key of Object.keys(value)) value[key] = fill(value[key]);
    return value;
  };
  return fill(story);
}

// Centre and radius of most of the target and of the source where it ends, and some of the points.
function surroundings(clouds) {
  const low = [], high = [], some = [];
  for (const {points} of clouds) {
    const step = 3 * Math.max(1, Math.floor(points.length / 6000));
    for (let i = 0; i + 2 < points.length; i += step) some.push([points[i], points[i + 1], points[i + 2]]);
  }
  for (let k = 0; k < 3; k++) {
    const values = some.map(p => p[k]).sort((a, b) => a - b);
    low.push(values[Math.floor(0.01 * values.length)]);
    high.push(values[Math.ceil(0.99 * values.length) - 1]);
  }
  return {
    some,
    centre: low.map((x, k) => 0.5 * (x + high[k])),
    radius: 0.5 * Math.hypot(...high.map((x, k) => x - low[k])) || 1,
  };
}

function begin(story) {
  learn(story);
  const {moments, source, target, free} = story, wrong = story.believed === false;
  const placed = moments.map(() => null), dark = matchMedia("(prefers-color-scheme: dark)");
  const at = i => placed[i] ||= moved(source, moments[i].pose);
  const look = new Looking(story.frame, surroundings([target, at(story.result)]), () => {
    const box = byId("view").getBoundingClientRect();
    return [box.width || 1, box.height || 1];
  });
  const points = new Points(byId("points")), lines = new Lines(byId("lines"));
  const plots = new Plots(story, byId("plots"));
  const state = {
    moment: story.result, mode: wrong ? "agreement" : "clouds", playing: 0,
    source: true, target: true, rays: true, sensors: true, free: true,
  };
  let colours, waiting = 0;

  const theme = () => THEMES[dark.matches ? "dark" : "light"];
  const later = () => { waiting ||= requestAnimationFrame(() => { waiting = 0; draw(); }); };

  function draw() {
    const t = theme(), layers = [];
    if (state.target) layers.push({cloud: target, colours: colours.target});
    if (state.source) layers.push({cloud: at(state.moment), colours: colours.source});
    points.draw(layers, look, packed(rgb(t.page)));
    lines.begin(look);
    if (state.rays) drawRays();
    if (state.free) free.forEach(drawFree);
    if (state.sensors) {
      if (target.viewpoint) lines.mark(target.viewpoint, "target’s sensor", MEAN.target, t.page);
      if (source.viewpoint) lines.mark(carried(source.viewpoint), "source’s sensor", MEAN.source, t.page);
    }
    drawScale(t);
    document.documentElement.dataset.drawn = state.moment;
  }

  function carried(p) {
    const m = moments[state.moment].pose;
    return [0, 4, 8].map(r => m[r] * p[0] + m[r + 1] * p[1] + m[r + 2] * p[2] + m[r + 3]);
  }

  const MOST_RAYS = 125;
  function rays(codes, cloud, from) {
    const rows = [];
    codes.forEach((code, i) => { if (code === 1) rows.push(i); });
    const step = Math.max(1, Math.ceil(rows.length / MOST_RAYS));
    return rows.filter((_, i) => i % step === 0).map(i => [from, Array.from(cloud.points.subarray(3 * i, 3 * i + 3))]);
  }

  function allRays() {
    if (!story.views) return [];
    const {source: mine, target: theirs} = moments[state.moment];
    return [
      ...rays(mine, at(state.moment), target.viewpoint),
      ...rays(theirs, target, carried(source.viewpoint)),
    ];
  }

  function drawRays() {
    lines.context.globalAlpha = 0.35;
    for (const [a, b] of allRays()) lines.line(a, b, MEAN.violated);
    lines.context.globalAlpha = 1;
  }

  function drawFree(one) {
    const reach = 0.35 * look.box.radius, middle = one.through, way = one.direction;
    if (!one.rotation) {
      lines.arrow(middle, plus(middle, way, reach), MEAN.free);
      lines.arrow(middle, plus(middle, way, -reach), MEAN.free);
      return;
    }
    lines.line(plus(middle, way, -reach), plus(middle, way, reach), MEAN.free, 2, [7, 5]);
    const side = unit(cross(way, Math.abs(way[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0])), other = cross(way, side);
    const ring = a => plus(plus(middle, side, 0.5 * reach * Math.cos(a)), other, 0.5 * reach * Math.sin(a));
    for (let k = 0; k < 30; k++) lines.line(ring(0.18 * k), ring(0.18 * (k + 1)), MEAN.free, 3);
    lines.arrow(ring(5.4), ring(5.6), MEAN.free);
  }

  // How long a round length at the centre is on the screen.
  function drawScale(t) {
    const per = look.scale(lines.width, lines.height) / look.away, raw = 110 / per;
    const ten = 10 ** Math.floor(Math.log10(raw)), long = [5, 2, 1].map(k => k * ten).find(x => x <= raw);
    const c = lines.context, x = 16, y = lines.height - (lines.width < 600 ? 56 : 22);
    c.strokeStyle = t.text; c.lineWidth = 2; c.beginPath();
    c.moveTo(x, y - 4); c.lineTo(x, y); c.lineTo(x + long * per, y); c.lineTo(x + long * per, y - 4); c.stroke();
    lines.word(metres(long), x, y - 8, t.text, t.page);
  }

  function recolour() {
    const moment = moments[state.moment], t = theme();
    colours = coloured(state.mode, story, moment, t);
    byId("legend").innerHTML = legend(state.mode, story, moment, t);
    if (story.image) {
      const {width, height, rows} = story.image, canvas = byId("field");
      [canvas.width, canvas.height] = [width, height];
      const context = canvas.getContext("2d"), image = context.createImageData(width, height);
      const pixels = new Uint32Array(image.data.buffer);
      // Two clouds in two colours make an image in one: the labels say more.
      const labels = state.mode === "clouds" && story.probability;
      const shown = labels ? coloured("probability", story, moment, t).source : colours.source;
      byId("field-note").textContent = labels
        ? "Inliers green, outliers grey, as decided at the result; empty where nothing was observed."
        : "In the same colours, at the same moment; empty where nothing was observed.";
      rows.forEach((row, i) => { pixels[i] = row < 0 ? 0 : 0xff000000 | shown[row]; });
      context.putImageData(image, 0, 0);
    }
    later();
  }

  function go(i) {
    state.moment = Math.min(Math.max(i, 0), moments.length - 1);
    const moment = moments[state.moment], slider = byId("slider");
    slider.value = state.moment;
    slider.setAttribute("aria-valuetext", moment.title);
    const note = moment.run ? (moment.chosen ? "led to the result" : "given up for another") : "";
    byId("moment").innerHTML = `${moment.title}<small>${note || `${state.moment + 1} of ${moments.length}`}</small>`;
    for (const button of byId("switch").children) button.setAttribute("aria-pressed", Number(button.value) === state.moment);
    const bad = wrong && state.moment === story.result, given = moment.run > 0 && !moment.chosen;
    byId("view").classList.toggle("wrong", bad);
    byId("stamp").hidden = !bad && !given;
    byId("stamp").className = bad ? "bad" : "";
    byId("stamp").textContent = bad ? story.verdict.split(/[,(.]/)[0] : "given up";
    byId("histogram").innerHTML = histogram(story, moment);
    plots.at(state.moment);
    const count = allRays().length;
    byId("rays-note").textContent = !story.views ? "needs viewpoints" : count ? "" : "none here";
    recolour();
  }

  function play(on) {
    clearInterval(state.playing);
    state.playing = on ? setInterval(() => {
      if (state.moment >= story.result) play(false); else go(state.moment + 1);
    }, 220) : 0;
    if (on && state.moment >= story.result) go(0);
    byId("play").textContent = on ? "❚❚" : "▶";
    byId("play").setAttribute("aria-label", on ? "Pause" : "Play");
  }

  function words() {
    byId("title").textContent = story.title;
    byId("verdict").textContent = story.verdict;
    byId("verdict").className = story.believed === null ? "" : wrong ? "bad" : "good";
    byId("advice").textContent = story.advice;
    for (const [name, value] of story.facts) {
      const [dt, dd] = ["dt", "dd"].map(tag => byId("facts").appendChild(document.createElement(tag)));
      [dt.textContent, dd.textContent] = [name, value];
    }
    for (const [name, cloud] of [["Source", source], ["Target", target]]) {
      const [dt, dd] = ["dt", "dd"].map(tag => byId("facts").appendChild(document.createElement(tag)));
      [dt.textContent, dd.textContent] = [`${name} seen`, cloud.view];
    }
    byId("count").textContent = `Shown: ${source.count} of the source, ${target.count} of the target.`;
    for (const one of free) byId("free").appendChild(document.createElement("li")).textContent = `Free: ${one.text}`;
  }

  function controls() {
    const poses = [[0, "Start"], [story.result, "Result"]];
    if (moments.length > story.result + 1) poses.push([story.result + 1, "True pose"]);
    for (const [value, text] of poses) {
      const button = byId("switch").appendChild(document.createElement("button"));
      Object.assign(button, {type: "button", value, textContent: text, onclick: () => { play(false); go(value); }});
    }
    const modes = Object.keys(NAMES).filter(mode => mode !== "probability" || story.probability);
    byId("colouring").innerHTML = modes.map(mode =>
      `<label><input type="radio" name="mode" value="${mode}"${mode === state.mode ? " checked" : ""}>${NAMES[mode]}</label>`).join("");
    byId("colouring").onchange = e => { state.mode = e.target.value; recolour(); };
    const boxes = {target: "target", source: "source", rays: "violated lines of sight", sensors: "where the sensors stood", free: "free directions"};
    const there = {rays: story.views, sensors: source.viewpoint || target.viewpoint, free: free.length > 0};
    byId("shown").innerHTML = Object.entries(boxes).filter(([name]) => name === "rays" || there[name] !== false && there[name] !== null).map(([name, text]) =>
      `<label${name === "rays" && !story.views ? ' class="off"' : ""}><input type="checkbox" value="${name}"${name === "rays" && !story.views ? " disabled" : " checked"}>${text}${name === "rays" ? ' <span class="quiet" style="margin:0" id="rays-note"></span>' : ""}</label>`).join("");
    byId("shown").onchange = e => { state[e.target.value] = e.target.checked; later(); };
    byId("slider").max = moments.length - 1;
    byId("slider").oninput = e => { play(false); go(Number(e.target.value)); };
    byId("play").onclick = () => play(!state.playing);
    const looks = {
      start: () => look.reset(),
      sensor: () => look.from(target.viewpoint),
      above: () => look.above(),
    };
    for (const button of byId("looks").children) {
      button.hidden = button.dataset.look === "sensor" && !target.viewpoint;
      button.onclick = () => { looks[button.dataset.look](); later(); };
    }
    byId("image").hidden = !story.image;
    byId("numbers").hidden = plots.empty;
    runStrip(byId("runs"), moments);
    handle(byId("points"), look, later);
    addEventListener("keydown", e => {
      if (e.target.type === "radio" || e.target.type === "range" || e.ctrlKey || e.altKey || e.metaKey) return;
      const step = {ArrowLeft: -1, ArrowRight: 1}[e.key];
      if (step) { play(false); go(state.moment + step); e.preventDefault(); }
      if (e.key === " " && !/^(BUTTON|INPUT|A)$/.test(e.target.tagName)) { play(!state.playing); e.preventDefault(); }
    });
    new ResizeObserver(later).observe(byId("view"));
    dark.addEventListener("change", recolour);
  }

  words();
  controls();
  go(state.moment);
  draw();
}

read().then(begin).catch(error => {
  byId("verdict").className = "bad";
  byId("verdict").textContent = `This page cannot be shown: ${error.message}. It needs a browser of 2023 or newer.`;
  throw error;
});
