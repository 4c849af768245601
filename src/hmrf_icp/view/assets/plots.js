// Small plots: the histogram of a moment, and each number over the timeline.

const WIDE = 320;
const plain = text => text.replace(/[&<>"]/g, c => `&#${c.charCodeAt(0)};`);
const shownNumber = (name, x) => name.endsWith(", m") ? metres(x)
  : name.endsWith(", share") ? `${(100 * x).toFixed(1)} %`
  : name.endsWith(", degrees") ? `${Number(x.toPrecision(3))}°` : `${Number(x.toPrecision(3))}`;

function histogram(story, moment) {
  const {edges} = story, most = Math.max(...story.moments.map(one => Math.max(...one.histogram)));
  const n = moment.histogram.length, low = Math.log(edges[0]), span = Math.log(edges[n]) - low;
  const tall = 92, x = d => (Math.log(d) - low) / span * WIDE;
  const bars = moment.histogram.map((share, i) =>
    `<rect class="bar" x="${(i * WIDE / n + 0.5).toFixed(1)}" width="${(WIDE / n - 1).toFixed(1)}" y="${(tall - tall * share / most).toFixed(1)}" height="${(tall * share / most).toFixed(1)}"/>`);
  const decades = [];
  for (let k = Math.ceil(Math.log10(edges[0])); 10 ** k <= edges[n]; k++) decades.push(10 ** k);
  const ticks = decades.map(d => {
    const at = Math.min(Math.max(x(d), 20), WIDE - 20);
    return `<line class="axis" x1="${x(d)}" x2="${x(d)}" y1="0" y2="${tall + 3}"/><text x="${at}" y="${tall + 15}" text-anchor="middle">${metres(d)}</text>`;
  });
  return `<svg viewBox="0 0 ${WIDE} ${tall + 19}" role="img" aria-label="Histogram of distances">${ticks.join("")}${bars.join("")}</svg>`
    + `<p class="quiet">Up to ${(100 * most).toPrecision(2)} % of the source’s points in a bin of equal ratio; the last holds what is farther.</p>`;
}

// One plot for each number that changes; those that never do are told in a line.
class Plots {
  constructor(story, element) {
    this.moments = story.moments;
    const names = [...new Set(story.moments.flatMap(one => Object.keys(one.numbers)))];
    const changing = [], constant = [];
    for (const name of names) {
      const values = this.moments.map(one => one.numbers[name]).filter(x => x !== undefined);
      (Math.max(...values) > Math.min(...values) ? changing : constant).push([name, values]);
    }
    element.innerHTML = changing.map(([name, values]) => this.plot(name, values)).join("")
      + (constant.length ? `<p class="quiet">Constant: ${constant.map(([name, values]) => `${plain(name.replace(/, (m|degrees|share)$/, ""))} ${shownNumber(name, values[0])}`).join(", ")}.</p>` : "");
    this.shown = changing.map(([name], i) => [name, element.querySelectorAll(".plot b")[i], element.querySelectorAll(".cursor")[i]]);
    this.empty = names.length === 0;
  }

  x(i) { return (i + 0.5) * WIDE / this.moments.length; }

  plot(name, values) {
    const tall = 40, low = Math.min(...values), high = Math.max(...values);
    const log = low > 0 && high > 30 * low, scaled = v => log ? Math.log(v) : v;
    const y = v => tall - 3 - (tall - 6) * (scaled(v) - scaled(low)) / (scaled(high) - scaled(low));
    const runs = new Map();
    this.moments.forEach((one, i) => {
      const value = one.numbers[name];
      if (value === undefined || !one.run) return;
      const key = `${one.run} ${one.chosen}`;
      if (!runs.has(key)) runs.set(key, {chosen: one.chosen, at: []});
      runs.get(key).at.push(`${this.x(i).toFixed(1)},${y(value).toFixed(1)}`);
    });
    const curves = [...runs.values()].map(({chosen, at}) => at.length > 1
      ? `<polyline class="curve${chosen ? " chosen" : ""}" points="${at.join(" ")}"/>`
      : `<circle class="curve${chosen ? " chosen" : ""}" r="1.5" cx="${at[0].split(",")[0]}" cy="${at[0].split(",")[1]}"/>`);
    const label = plain(name.replace(/, (m|degrees|share)$/, ""));
    return `<div class="plot"><p><span>${label} <small>${shownNumber(name, low)} to ${shownNumber(name, high)}${log ? ", log" : ""}</small></span><b></b></p><svg viewBox="0 0 ${WIDE} ${tall}" role="img" aria-label="${label} over the timeline"><line class="axis" x1="0" x2="${WIDE}" y1="${tall - 0.5}" y2="${tall - 0.5}"/>${curves.join("")}<line class="cursor" y1="0" y2="${tall}"/></svg></div>`;
  }

  at(i) {
    for (const [name, value, cursor] of this.shown) {
      const x = this.moments[i].numbers[name];
      value.textContent = x === undefined ? "" : shownNumber(name, x);
      for (const end of ["x1", "x2"]) cursor.setAttribute(end, this.x(i));
    }
  }
}

// Which run of the loop each stretch of the timeline belongs to.
function runStrip(svg, moments) {
  svg.setAttribute("viewBox", `0 0 ${moments.length} 9`);
  svg.setAttribute("preserveAspectRatio", "none");
  const stretches = [];
  moments.forEach((one, i) => {
    const last = stretches.at(-1);
    if (last && last.run === one.run && last.chosen === one.chosen) last.end = i + 1;
    else stretches.push({run: one.run, chosen: one.chosen, begin: i, end: i + 1});
  });
  const gap = 0.002 * moments.length;
  svg.innerHTML = stretches.map(({chosen, begin, end}) =>
    `<rect x="${begin + gap}" width="${end - begin - 2 * gap}" y="1" height="7" fill="var(--${chosen ? "accent" : "mute"})"/>`).join("");
}
