// From where one looks: a turntable about the axis that points up, in perspective.

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [
  a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0],
];
const plus = (a, b, k = 1) => [a[0] + k * b[0], a[1] + k * b[1], a[2] + k * b[2]];
const unit = a => { const n = Math.hypot(...a) || 1; return a.map(x => x / n); };
const turned = (v, axis, by) => {
  const c = Math.cos(by), s = Math.sin(by), along = dot(v, axis) * (1 - c), w = cross(axis, v);
  return [0, 1, 2].map(i => v[i] * c + w[i] * s + axis[i] * along);
};

const FOCAL = 1.6; // of half the smaller side: 64 degrees across it
const INSIDE = 0.985, MARGIN = 1.15; // share of the points that is to be seen, and room beside them

class Looking {
  // frame: rows right, up, towards; box: what is to be seen, {centre, radius, some};
  // size: gives width and height of the view.
  constructor(frame, box, size) {
    this.box = box;
    this.size = size;
    this.first = [frame.slice(0, 3), frame.slice(3, 6), frame.slice(6, 9)];
    const most = [0, 1, 2].reduce((a, b) => Math.abs(this.first[1][b]) > Math.abs(this.first[1][a]) ? b : a);
    this.axis = [0, 0, 0];
    this.axis[most] = Math.sign(this.first[1][most]);
    this.reset();
  }

  reset() {
    [this.right, this.up, this.towards] = this.first;
    this.fit();
  }

  // Look from a place towards the centre.
  from(place) {
    const offset = plus(place, this.box.centre, -1);
    this.centre = this.box.centre;
    this.away = Math.max(Math.hypot(...offset), 0.05 * this.box.radius);
    this.level(unit(offset));
  }

  // Go as near as leaves all but a few stray points inside, with as much room left as right.
  fit() {
    const [width, height] = this.size(), side = FOCAL * Math.min(width, height), {some} = this.box;
    const sorted = values => Float64Array.from(values).sort();
    const most = Math.floor(INSIDE * (some.length - 1)), least = some.length - 1 - most;
    this.centre = this.box.centre;
    for (let k = 0; k < 5; k++) {
      const places = some.map(p => {
        const d = plus(p, this.centre, -1);
        return [dot(d, this.right), dot(d, this.up), dot(d, this.towards)];
      });
      this.away = Math.max(0.1 * this.box.radius, sorted(places.map(([x, y, z]) =>
        z + MARGIN * side * Math.max(Math.abs(x) / width, Math.abs(y) / height)))[most]);
      [this.right, this.up].forEach((axis, a) => {
        const seen = sorted(places.map(p => p[a] / Math.max(this.away - p[2], 0.01 * this.away)));
        this.centre = plus(this.centre, axis, 0.5 * (seen[least] + seen[most]) * this.away);
      });
    }
  }

  above() {
    this.towards = this.axis;
    this.right = unit(plus(this.first[0], this.axis, -dot(this.first[0], this.axis)));
    this.up = cross(this.towards, this.right);
    this.fit();
  }

  level(towards) {
    const right = cross(this.axis, towards);
    if (Math.hypot(...right) > 1e-3) this.right = unit(right);
    this.towards = towards;
    this.up = unit(cross(this.towards, this.right));
  }

  turn(dx, dy) {
    let towards = turned(this.towards, this.axis, -dx);
    const right = turned(this.right, this.axis, -dx);
    const pitched = turned(towards, right, -dy);
    const steep = Math.abs(dot(pitched, this.axis));
    if (steep < 0.995 || steep < Math.abs(dot(towards, this.axis))) towards = pitched;
    this.right = right;
    this.level(towards);
  }

  shift(dx, dy, height) {
    const k = 2 * this.away / (FOCAL * height);
    this.centre = plus(plus(this.centre, this.right, -dx * k), this.up, dy * k);
  }

  zoom(by) {
    this.away = Math.min(Math.max(this.away * by, 1e-3 * this.box.radius), 40 * this.box.radius);
  }

  // Pixels and depth of a place; null behind the eye.
  project(p, width, height) {
    const d = plus(p, this.centre, -1), z = this.away - dot(d, this.towards);
    if (z <= 1e-3 * this.away) return null;
    const f = this.scale(width, height) / z;
    return [0.5 * width + f * dot(d, this.right), 0.5 * height - f * dot(d, this.up), z];
  }

  scale(width, height) { return FOCAL * 0.5 * Math.min(width, height); }
}

// Turns what hands do on an element into turns, shifts and zooms.
function handle(element, look, changed) {
  const touching = new Map();
  let gap = 0, middle = null;
  const spread = () => {
    const [a, b] = [...touching.values()];
    return [Math.hypot(a[0] - b[0], a[1] - b[1]), [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2]];
  };
  element.addEventListener("pointerdown", e => {
    element.setPointerCapture(e.pointerId);
    touching.set(e.pointerId, [e.clientX, e.clientY]);
    if (touching.size === 2) [gap, middle] = spread();
  });
  element.addEventListener("pointermove", e => {
    const before = touching.get(e.pointerId);
    if (!before) return;
    const dx = e.clientX - before[0], dy = e.clientY - before[1], side = element.clientHeight;
    touching.set(e.pointerId, [e.clientX, e.clientY]);
    if (touching.size === 2) {
      const [now, here] = spread();
      if (gap && now) look.zoom(gap / now);
      look.shift(here[0] - middle[0], here[1] - middle[1], side);
      [gap, middle] = [now, here];
    } else if (e.shiftKey || e.buttons & 6) look.shift(dx, dy, side);
    else look.turn(dx * 0.008, dy * 0.008);
    changed();
  });
  for (const end of ["pointerup", "pointercancel"])
    element.addEventListener(end, e => touching.delete(e.pointerId));
  element.addEventListener("contextmenu", e => e.preventDefault());
  element.addEventListener("wheel", e => {
    e.preventDefault();
    const lines = e.deltaMode === 1 ? 16 : 1;
    look.zoom(Math.exp(Math.min(Math.max(e.deltaY * lines, -200), 200) * 0.0015));
    changed();
  }, {passive: false});
}
