// What the colours mean. They can be told apart with any common colour blindness.

const rgb = hex => [1, 3, 5].map(i => parseInt(hex.slice(i, i + 2), 16));
const packed = ([r, g, b]) => r | g << 8 | b << 16;
const ramp = stops => {
  const colours = stops.map(rgb);
  return Array.from({length: 256}, (_, level) => {
    const at = level / 255 * (colours.length - 1), i = Math.min(Math.floor(at), colours.length - 2);
    return packed(colours[i].map((v, k) => Math.round(v + (at - i) * (colours[i + 1][k] - v))));
  });
};
const css = stops => `linear-gradient(90deg, ${stops.join(", ")})`;

const DISTANCE = ["#440154", "#414487", "#2a788e", "#22a884", "#7ad151", "#fde725"]; // viridis
const THEMES = {
  light: {page: "#ffffff", text: "#1b1f24", grey: "#a3a9b0"},
  dark: {page: "#14171b", text: "#e6e9ed", grey: "#6d757e"},
};

// The package's own colours come with the story: one meaning each, in every picture.
let MEAN, RAMPS;
function learn(story) {
  MEAN = story.colours;
  RAMPS = {distance: ramp(DISTANCE), probability: ramp([MEAN.outlier, MEAN.inlier])};
}

const NAMES = {
  clouds: "The two clouds",
  agreement: "Agreement with the other’s view",
  distance: "Distance to the target",
  probability: "Probability of being an inlier",
};

// Colours of the source's and the target's points at a moment.
function coloured(mode, story, moment, theme) {
  const n = story.source.points.length / 3, m = story.target.points.length / 3;
  const source = new Uint32Array(n), target = new Uint32Array(m);
  const {probability} = story;
  target.fill(packed(rgb(mode === "clouds" || mode === "probability" ? MEAN.target : theme.grey)));
  if (mode === "agreement") {
    const colours = MEAN.agreement.map(c => packed(rgb(c)));
    for (let i = 0; i < n; i++) source[i] = colours[moment.source[i]];
    for (let i = 0; i < m; i++) target[i] = colours[moment.target[i]];
  } else if (mode === "distance") {
    for (let i = 0; i < n; i++) source[i] = RAMPS.distance[moment.distance[i]];
  } else if (mode === "probability") {
    for (let i = 0; i < n; i++) source[i] = RAMPS.probability[probability[i]];
  } else {
    source.fill(packed(rgb(MEAN.source)));
  }
  return {source, target};
}

const metres = x => {
  const [by, unit] = x < 1e-3 ? [1e6, "µm"] : x < 0.1 ? [1e3, "mm"] : x < 1e3 ? [1, "m"] : [1e-3, "km"];
  return `${Number((x * by).toPrecision(2))} ${unit}`;
};

function legend(mode, story, moment, theme) {
  const key = (colour, text, number = "") => `<div class="key"><i style="background:${colour}"></i><span>${text}</span><b>${number}</b></div>`;
  const scale = (stops, low, high) => `<div class="scale" style="background:${css(stops)}"></div><div class="ends"><span>${low}</span><span>${high}</span></div>`;
  const note = text => `<p class="quiet">${text}</p>`;
  if (mode === "agreement") {
    const counts = new Array(5).fill(0);
    for (const codes of [moment.source, moment.target]) for (const code of codes) counts[code]++;
    const all = moment.source.length + moment.target.length;
    const keys = story.agreement.map((text, i) => counts[i] || i < 2 ? key(MEAN.agreement[i], text, `${(100 * counts[i] / all).toFixed(1)} %`) : "");
    return keys.join("") + note(story.views
      ? "Each cloud’s points, held against what the other’s sensor saw. The shares are of both."
      : "No viewpoint is known of both clouds, so nobody knows which space was seen to be empty: points are held against the other’s surface.");
  }
  const grey = key(theme.grey, "target");
  if (mode === "distance")
    return scale(DISTANCE, metres(story.edges[0]), metres(story.edges.at(-1))) + grey + note("From a source point to the closest target point, on a logarithmic scale.");
  if (mode === "probability")
    return scale([MEAN.outlier, MEAN.inlier], "0, outlier", "inlier, 1") + key(MEAN.target, "target") + note("As decided at the result; at other poses the points keep these colours.");
  return key(MEAN.source, "source, moved", story.source.count) + key(MEAN.target, "target", story.target.count);
}
