// Draws points with a depth buffer of its own: thousands of points need no graphics card, and the
// picture is the same on every machine. Lines and words go on a canvas above it.

const MOST_PIXELS = 2.4e6;

// A canvas's size in its own pixels.
function fitted(canvas) {
  const box = canvas.getBoundingClientRect();
  let ratio = window.devicePixelRatio || 1;
  ratio = Math.min(ratio, Math.sqrt(MOST_PIXELS / Math.max(box.width * box.height, 1)));
  const width = Math.max(1, Math.round(box.width * ratio));
  const height = Math.max(1, Math.round(box.height * ratio));
  if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
  return {width, height, ratio};
}

// Points (3 N) and normals moved by a pose (16, row by row).
function moved(cloud, pose) {
  const n = cloud.points.length / 3, points = new Float32Array(3 * n), normals = new Float32Array(3 * n);
  for (let i = 0; i < 3 * n; i += 3)
    for (let k = 0; k < 3; k++) {
      const r = 4 * k;
      points[i + k] = pose[r] * cloud.points[i] + pose[r + 1] * cloud.points[i + 1]
        + pose[r + 2] * cloud.points[i + 2] + pose[r + 3];
      normals[i + k] = pose[r] * cloud.normals[i] + pose[r + 1] * cloud.normals[i + 1]
        + pose[r + 2] * cloud.normals[i + 2];
    }
  return {points, normals, spacing: cloud.spacing};
}

class Points {
  constructor(canvas) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d", {alpha: false});
  }

  // layers: [{cloud, colours}], colours (N) as 0xbbggrr; background likewise. Returns pixels set.
  draw(layers, look, background) {
    const {width, height, ratio} = fitted(this.canvas);
    if (!this.image || this.image.width !== width || this.image.height !== height) {
      this.image = this.context.createImageData(width, height);
      this.pixels = new Uint32Array(this.image.data.buffer);
      this.depth = new Float32Array(width * height);
    }
    this.pixels.fill(0xff000000 | background);
    this.depth.fill(Infinity);
    for (const {cloud, colours} of layers) this.layer(cloud, colours, look, width, height, ratio);
    this.context.putImageData(this.image, 0, 0);
  }

  layer(cloud, colours, look, width, height, ratio) {
    const {points, normals, spacing} = cloud, {pixels, depth} = this;
    const [cx, cy, cz] = look.centre, [rx, ry, rz] = look.right, [ux, uy, uz] = look.up;
    const [tx, ty, tz] = look.towards, away = look.away, near = 1e-3 * away;
    const f = look.scale(width, height), least = 1.6 * ratio, most = 9 * ratio;
    for (let i = 0, j = 0; i < points.length; i += 3, j++) {
      const x = points[i] - cx, y = points[i + 1] - cy, z = points[i + 2] - cz;
      const w = away - (x * tx + y * ty + z * tz);
      if (w <= near) continue;
      const k = f / w;
      const side = Math.round(Math.min(Math.max(1.25 * k * spacing, least), most));
      const left = Math.round(0.5 * width + k * (x * rx + y * ry + z * rz) - 0.5 * side);
      const top = Math.round(0.5 * height - k * (x * ux + y * uy + z * uz) - 0.5 * side);
      if (left >= width || top >= height || left + side <= 0 || top + side <= 0) continue;
      // Lit from where one looks; a point without a normal as if it faced half away.
      const nx = normals[i], ny = normals[i + 1], nz = normals[i + 2];
      const facing = Math.abs(nx * tx + ny * ty + nz * tz) / 127;
      const light = nx || ny || nz ? 0.5 + 0.5 * facing : 0.8;
      const c = colours[j];
      const colour = 0xff000000 | (light * (c >> 16 & 255)) << 16 | (light * (c >> 8 & 255)) << 8 | light * (c & 255);
      const x1 = Math.min(left + side, width), y1 = Math.min(top + side, height);
      for (let v = Math.max(top, 0); v < y1; v++)
        for (let u = Math.max(left, 0), at = v * width + u; u < x1; u++, at++)
          if (w < depth[at]) { depth[at] = w; pixels[at] = colour; }
    }
  }
}

class Lines {
  constructor(canvas) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
  }

  begin(look) {
    const {width, height, ratio} = fitted(this.canvas);
    Object.assign(this, {look, ratio, width: width / ratio, height: height / ratio});
    this.context.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.context.clearRect(0, 0, this.width, this.height);
    this.said = [];
  }

  place(p) { return this.look.project(p, this.width, this.height); }

  // A line between two places, cut where it would pass behind the eye.
  line(a, b, colour, thick = 1, dashes = []) {
    const near = 2e-3 * this.look.away, depth = p => this.look.away - dot(plus(p, this.look.centre, -1), this.look.towards);
    let [da, db] = [depth(a), depth(b)];
    if (da < near && db < near) return;
    const cut = (p, q, dp, dq) => plus(p, plus(q, p, -1), (near - dp) / (dq - dp));
    if (da < near) a = cut(a, b, da, db);
    else if (db < near) b = cut(b, a, db, da);
    const [p, q] = [this.place(a), this.place(b)], c = this.context;
    if (!p || !q) return;
    c.strokeStyle = colour; c.lineWidth = thick; c.setLineDash(dashes);
    c.beginPath(); c.moveTo(p[0], p[1]); c.lineTo(q[0], q[1]); c.stroke();
    c.setLineDash([]);
  }

  // An arrow whose head does not shrink with the distance.
  arrow(a, b, colour) {
    this.line(a, b, colour, 3);
    const [p, q] = [this.place(a), this.place(b)], c = this.context;
    if (!p || !q) return;
    const way = Math.atan2(q[1] - p[1], q[0] - p[0]);
    c.fillStyle = colour; c.beginPath(); c.moveTo(q[0], q[1]);
    for (const side of [-0.45, 0.45])
      c.lineTo(q[0] - 13 * Math.cos(way + side), q[1] - 13 * Math.sin(way + side));
    c.fill();
  }

  mark(p, text, colour, halo) {
    const at = this.place(p), c = this.context;
    if (!at || at[0] < 0 || at[1] < 0 || at[0] > this.width || at[1] > this.height) return;
    c.fillStyle = colour; c.strokeStyle = halo; c.lineWidth = 2;
    c.beginPath(); c.arc(at[0], at[1], 5, 0, 7); c.fill(); c.stroke();
    const wide = (c.font = "600 12px system-ui, sans-serif", c.measureText(text).width);
    const fits = at[0] + wide + 12 < this.width, x = fits ? at[0] + 9 : at[0] - wide - 9;
    // Below another's words where the two would lie on each other.
    let y = at[1] + 4;
    const below = other => x < other.right && x + wide > other.left && Math.abs(y - other.y) < 15;
    for (let hit; (hit = this.said.find(below)); ) y = hit.y + 16;
    this.said.push({left: x, right: x + wide, y});
    this.word(text, x, y, colour, halo);
  }

  word(text, x, y, colour, halo) {
    const c = this.context;
    c.font = "600 12px system-ui, sans-serif"; c.lineJoin = "round";
    c.strokeStyle = halo; c.lineWidth = 4; c.strokeText(text, x, y);
    c.fillStyle = colour; c.fillText(text, x, y);
  }
}
