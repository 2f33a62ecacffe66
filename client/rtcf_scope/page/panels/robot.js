// The robot of the runner in 3-D. It moves with the signals of its joints; a ghost shows its target;
// picking a joint shows its signals. three.js draws it, and is loaded when the panel is opened.
import { meshOf } from "../data/stl.js";
import { fixed } from "../drawing/axes.js";
import { ink } from "../drawing/palette.js";
import { ask, query, request } from "../server.js";

const GHOST = 0.2, UNKNOWN = 0.15; // opacity: of the target, and of a robot whose position is not known
const NO_POSITION = "position unknown: its joints have no values";
const NEAR = Math.PI / 180, NEAR_SLIDE = 1e-3; // rad, m; a target closer to all positions is not drawn
const POSE = ["position.x", "position.y", "position.z", "orientation.x", "orientation.y", "orientation.z", "orientation.w"];
const CLICK = 4; // CSS pixels; a longer movement is a drag
const SIDES = 48; // of a round shape

// Returns whether WebGL runs without a graphics card. Smooth edges are then the most expensive part.
function drawsBySoftware() {
  const gl = document.createElement("canvas").getContext("webgl"), names = gl?.getExtension("WEBGL_debug_renderer_info");
  const name = names ? gl.getParameter(names.UNMASKED_RENDERER_WEBGL) : "";
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software/i.test(name);
}

export class Robot {
  // `page.runner()`: the name of the runner; `onPick(signals)`: a joint was picked;
  // `onSignals()`: the signals to watch have changed.
  constructor(scope, box, page, { onPick, onSignals }) {
    Object.assign(this, { scope, box, page, onPick, onSignals });
    this.canvas = box.querySelector("canvas");
    this.list = box.querySelector("[role=list]");
    this.says = box.querySelector("output");
    this.ghost = box.querySelector("[name=ghost]");
    this.ghost.onchange = () => { this.drawn = ""; };
    box.querySelector("[name=home]").onclick = () => { if (this.links.size) this.#look(); };
    this.isOpen = false;
    this.links = new Map(); // by name: {group, ghost, moves}
    this.joints = [];
    this.bodies = []; // around the robot: {group, pose}, where `pose` has its signals, or is null
    this.space = null; // the space to show: {low, high}, m
    this.signals = [];
    this.picked = "";
    this.drawn = ""; // the values that are drawn
    this.description = ""; // of the robot and its signals, as it was received
    this.form = ""; // the part of it that is drawn
    this.frames = 0; // drawn so far
    this.loads = 0; // finished so far, for tests
    this.lastLoad = Promise.resolve();
  }

  // `found`: the robot, if it is known.
  async open(found) {
    this.isOpen = true;
    this.box.hidden = false;
    await this.load(found);
  }

  close() {
    this.isOpen = false;
    this.box.hidden = true;
    this.signals = [];
    this.description = "";
    this.onSignals();
  }

  request() { return ask(`/api/robot?${query({ runner: this.page.runner() })}`); }

  // Loads the robot after a change of the graph; requests it unless `known` is given. Loads run one after another.
  load(known) {
    this.lastLoad = this.lastLoad.then(() => this.#load(known));
    return this.lastLoad;
  }

  async #load(known) {
    if (!this.isOpen) return;
    try {
      const found = known ?? await this.request();
      this.says.textContent = found.links.length ? found.note ?? "" : "no robot: give a component the path of a URDF, or start the scope with --robot FILE";
      await this.#engine();
      await this.#build(found);
    } catch (error) {
      this.description = ""; // the next load tries again
      this.says.textContent = error.message;
    }
    this.loads++;
  }

  async #engine() {
    if (this.three) return;
    try {
      this.three = await import("/page/three/three.module.js");
    } catch {
      throw new Error("three.js is missing: install libjs-three");
    }
    const { WebGLRenderer, Scene, PerspectiveCamera, HemisphereLight, DirectionalLight, Raycaster } = this.three;
    try {
      this.renderer = new WebGLRenderer({ canvas: this.canvas, antialias: !drawsBySoftware(), alpha: true });
    } catch {
      this.three = null;
      throw new Error("this browser has no WebGL");
    }
    this.scene = new Scene();
    this.camera = new PerspectiveCamera(40, 1, 0.01, 100);
    this.camera.up.set(0, 0, 1);
    this.scene.add(new HemisphereLight(0xffffff, 0x707078, 0.75));
    const sun = new DirectionalLight(0xffffff, 0.55);
    sun.position.set(2, -3, 4);
    this.scene.add(sun);
    this.ray = new Raycaster();
    this.#bindPointer();
    new ResizeObserver(() => { this.drawn = ""; }).observe(this.canvas.parentElement);
  }

  // Makes the links and signals of a description; keeps unchanged ones.
  async #build(found) {
    const description = JSON.stringify(found), form = JSON.stringify([found.links, found.bodies, found.workspace]);
    if (description === this.description) return;
    this.#follow(found);
    this.description = description;
    if (form === this.form) return;
    const { Group } = this.three;
    for (const { group, ghost } of this.links.values()) { group.parent?.remove(group); ghost.parent?.remove(ghost); }
    this.links.clear();
    const meshes = new Map();
    await Promise.all(found.links.flatMap((link) => link.visuals).filter(({ shape }) => shape === "mesh").map(async ({ mesh }) => {
      meshes.set(mesh, meshes.get(mesh) ?? request(`/api/robot/mesh?${query({ name: mesh })}`).then((response) => response.arrayBuffer()).then(meshOf));
      await meshes.get(mesh);
    }));
    for (const link of found.links) {
      const made = { ...link, group: new Group(), ghost: new Group(), solids: [] };
      for (const visual of link.visuals) {
        const geometry = this.#geometry(visual, await meshes.get(visual.mesh));
        made.solids.push(this.#solid(made.group, geometry, visual, false));
        if (link.parent) this.#solid(made.ghost, geometry, visual, true);
      }
      for (const solid of made.solids) solid.userData.link = link.name;
      this.links.set(link.name, made);
    }
    for (const link of this.links.values()) {
      const parent = this.links.get(link.parent);
      (parent?.group ?? this.scene).add(link.group);
      (parent?.ghost ?? this.scene).add(link.ghost);
    }
    for (const { group } of this.bodies) this.scene.remove(group);
    this.bodies = (found.bodies ?? []).map((body) => {
      const group = new Group();
      this.#solid(group, this.#geometry(body), body, false);
      this.scene.add(group);
      return { group, pose: body.pose ? POSE.map((each) => `${body.pose}.${each}`) : null };
    });
    this.space = found.workspace ?? null;
    this.form = form;
    this.#pose(this.#values("position"), "group");
    this.#look();
    this.drawn = "";
  }

  // Stores the signals of the joints, and lists them.
  #follow(found) {
    this.joints = found.links.filter((link) => link.moves && found.signals[link.joint]).map((link) => ({ ...link, ...found.signals[link.joint] }));
    this.signals = this.joints.flatMap(({ position, target }) => (target ? [position, target] : [position]))
      .concat((found.bodies ?? []).flatMap(({ pose }) => (pose ? POSE.map((each) => `${pose}.${each}`) : [])));
    this.list.replaceChildren(...this.joints.map((joint) => {
      const row = document.createElement("button"), bar = document.createElement("meter"), says = document.createElement("span");
      row.type = "button";
      row.title = `show the signals of ${joint.joint}`;
      const hasRange = joint.lower < joint.upper;
      Object.assign(bar, hasRange ? { min: joint.lower, max: joint.upper } : { min: -Math.PI, max: Math.PI });
      row.append(Object.assign(document.createElement("b"), { textContent: joint.joint }), bar, says);
      row.onclick = () => this.#pick(joint.joint);
      joint.show = (value) => {
        bar.value = Number.isFinite(value) ? value : 0; // the element throws an exception for NaN
        says.textContent = Number.isFinite(value) ? joint.type === "prismatic" ? `${fixed(value * 1e3, 1)} mm` : `${fixed(value * 180 / Math.PI, 1)}°` : "–";
      };
      joint.row = row;
      return row;
    }));
    this.ghost.parentElement.hidden = !this.joints.some(({ target }) => target);
    this.onSignals();
    this.#mark();
  }

  #geometry(visual, mesh) {
    const { BufferGeometry, BufferAttribute, BoxBufferGeometry, CylinderBufferGeometry, SphereBufferGeometry } = this.three;
    if (visual.shape === "box") return new BoxBufferGeometry(...visual.size);
    if (visual.shape === "sphere") return new SphereBufferGeometry(visual.radius, SIDES, SIDES / 2);
    if (visual.shape === "cylinder") return new CylinderBufferGeometry(visual.radius, visual.radius, visual.length, SIDES).rotateX(Math.PI / 2);
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(mesh.positions, 3));
    geometry.setAttribute("normal", new BufferAttribute(mesh.normals, 3));
    geometry.setIndex(new BufferAttribute(mesh.index, 1));
    return visual.scale.every((each) => each === 1) ? geometry : geometry.scale(...visual.scale);
  }

  #solid(group, geometry, visual, isGhost) {
    const { Mesh, MeshPhongMaterial, MeshLambertMaterial, Color } = this.three, [r, g, b, a] = visual.rgba;
    const behind = { polygonOffset: true, polygonOffsetFactor: 2, polygonOffsetUnits: 2 }; // where robot and ghost coincide
    const material = isGhost ? new MeshLambertMaterial({ color: ink("accent"), transparent: true, opacity: GHOST, ...behind })
      : new MeshPhongMaterial({ color: new Color(r, g, b), shininess: 28, specular: 0x222222, transparent: a < 1, opacity: a });
    const solid = new Mesh(geometry, material);
    solid.userData.colour = material.color.clone();
    solid.userData.opacity = material.opacity;
    this.#place(solid, visual);
    group.add(solid);
    return solid;
  }

  // Puts an object at a URDF's origin: roll, pitch and yaw about fixed axes.
  #place(object, { xyz, rpy }) {
    object.position.set(...xyz);
    object.rotation.set(...rpy, "ZYX");
  }

  // The position or target of each joint; NaN where there is none.
  #values(which) {
    const { store } = this.scope, at = store.empty ? NaN : this.#at(store);
    return this.joints.map((joint) => valueOf(store, joint[which], at));
  }

  // Moves the bodies by their signals; one without values is hidden. Returns the values as text.
  #placeBodies() {
    const { store } = this.scope, at = store.empty ? NaN : this.#at(store), found = [];
    for (const { group, pose } of this.bodies) {
      if (!pose) continue;
      const values = pose.map((name) => valueOf(store, name, at));
      group.visible = values.every(Number.isFinite);
      if (group.visible) { group.position.set(...values.slice(0, 3)); group.quaternion.set(...values.slice(3)).normalize(); }
      found.push(...values.map((each) => each.toFixed(4)));
    }
    return found.join(" ");
  }

  // Returns the place of the newest cycle, or of the last visible one in a view that does not follow.
  #at(store) {
    const { scope } = this;
    if (scope.mode === "roll" && scope.view.follows) return store.end - 1;
    if (scope.mode === "trigger") return scope.readAt;
    return Math.max(store.begin, Math.min(store.find(scope.cursors.a ?? scope.view.end), store.end - 1));
  }

  // Turns the joints of the robot ("group") or of its ghost by the values of `joints`.
  #pose(values, which) {
    const { Quaternion, Vector3 } = this.three, by = new Map(this.joints.map(({ joint }, i) => [joint, values[i]]));
    for (const link of this.links.values()) {
      const object = link[which];
      if (!link.parent) continue;
      this.#place(object, link);
      if (!link.moves) continue;
      const { mimic } = link;
      const mimicked = mimic ? by.get(mimic.joint) * mimic.multiplier + mimic.offset : NaN;
      const moved = [by.get(link.joint), mimicked, 0].find(Number.isFinite);
      const axis = new Vector3(...link.axis).normalize();
      if (link.type === "prismatic") object.translateOnAxis(axis, moved);
      else object.quaternion.multiply(new Quaternion().setFromAxisAngle(axis, moved));
    }
  }

  // Draws the robot faintly while its position is not known.
  #fade(is) {
    if (is !== (this.says.textContent === NO_POSITION)) this.says.textContent = is ? NO_POSITION : "";
    for (const { solids } of this.links.values())
      for (const { material, userData: { opacity } } of solids) {
        material.opacity = is ? UNKNOWN * opacity : opacity;
        material.transparent = is || opacity < 1;
      }
  }

  // Applies the colours of the theme.
  themed() {
    if (!this.size) return;
    const { GridHelper } = this.three;
    if (this.grid) this.scene.remove(this.grid);
    this.grid = new GridHelper(4 * this.size, 20, ink("axis"), ink("grid"));
    this.grid.rotateX(Math.PI / 2);
    this.grid.position.z = this.floor;
    this.scene.add(this.grid);
    this.drawn = "";
  }

  // Looks at the whole robot and its workspace, from the front and above.
  #look() {
    const { Box3, Vector3 } = this.three, box = new Box3();
    this.scene.updateMatrixWorld(true);
    for (const { solids } of this.links.values()) for (const solid of solids) box.expandByObject(solid);
    for (const { group, pose } of this.bodies) if (!pose) box.expandByObject(group);
    if (this.space) box.expandByPoint(new Vector3(...this.space.low)).expandByPoint(new Vector3(...this.space.high));
    if (box.isEmpty()) box.set(new Vector3(-0.5, -0.5, 0), new Vector3(0.5, 0.5, 1));
    this.size = Math.max(box.getSize(new Vector3()).length(), 0.05);
    this.floor = Math.min(box.min.z, 0);
    this.centre = box.getCenter(new Vector3());
    this.orbit = { distance: 1.5 * this.size, turn: -0.9, tilt: 0.38 };
    this.themed();
  }

  // The mouse turns, moves and scales the view; a click picks.
  #bindPointer() {
    const { canvas } = this;
    let down = null;
    canvas.onpointerdown = (event) => {
      canvas.setPointerCapture(event.pointerId);
      down = { x: event.clientX, y: event.clientY, way: 0, pans: event.button !== 0 || event.shiftKey };
    };
    canvas.onpointermove = (event) => {
      if (!down) return;
      const x = event.clientX - down.x, y = event.clientY - down.y;
      Object.assign(down, { x: event.clientX, y: event.clientY, way: down.way + Math.abs(x) + Math.abs(y) });
      if (down.pans) this.#pan(x, y);
      else {
        this.orbit.turn -= x * 0.008;
        this.orbit.tilt = Math.max(-1.5, Math.min(1.5, this.orbit.tilt + y * 0.008));
      }
      this.drawn = "";
    };
    canvas.onpointerup = (event) => {
      if (down && down.way < CLICK) this.#pick(this.#jointAt(event.offsetX, event.offsetY));
      down = null;
    };
    canvas.oncontextmenu = (event) => event.preventDefault();
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.orbit.distance *= Math.exp(Math.max(-1, Math.min(1, event.deltaY * 0.001)));
      this.drawn = "";
    }, { passive: false });
  }

  #pan(x, y) {
    const { Vector3 } = this.three, unit = this.orbit.distance * 0.73 / this.canvas.clientHeight;
    const right = new Vector3().setFromMatrixColumn(this.camera.matrix, 0), up = new Vector3().setFromMatrixColumn(this.camera.matrix, 1);
    this.centre.addScaledVector(right, -x * unit).addScaledVector(up, y * unit);
  }

  // Returns the joint of the link at a position of the canvas.
  #jointAt(x, y) {
    const { Vector2 } = this.three, { clientWidth, clientHeight } = this.canvas;
    this.ray.setFromCamera(new Vector2(2 * x / clientWidth - 1, 1 - 2 * y / clientHeight), this.camera);
    const [hit] = this.ray.intersectObjects([...this.links.values()].flatMap(({ solids }) => solids));
    let link = hit && this.links.get(hit.object.userData.link);
    while (link && !this.joints.some(({ joint }) => joint === link.joint)) link = this.links.get(link.parent);
    return link?.joint ?? "";
  }

  #pick(name) {
    this.picked = name;
    this.#mark();
    const joint = this.joints.find((each) => each.joint === name);
    if (joint) this.onPick([...joint.all, ...(joint.target && !joint.all.includes(joint.target) ? [joint.target] : [])]);
  }

  #mark() {
    for (const joint of this.joints) joint.row.setAttribute("aria-pressed", String(joint.joint === this.picked));
    for (const link of this.links.values())
      for (const { material, userData } of link.solids) {
        material.color.copy(userData.colour);
        if (link.joint && link.joint === this.picked) material.color.lerp(new this.three.Color(ink("accent")), 0.65);
      }
    this.drawn = "";
  }

  // Draws if something has changed; returns whether it drew.
  frame() {
    if (!this.isOpen || !this.renderer || !this.links.size) return false;
    const values = this.#values("position"), targets = this.#values("target");
    const drawn = `${this.#placeBodies()} ${values.map((each) => each.toFixed(5))} ${this.ghost.checked && targets.map((each) => each.toFixed(5))}`;
    if (drawn === this.drawn) return false;
    this.drawn = drawn;
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement;
    if (width < 2 || height < 2) return false;
    const ratio = Math.min(devicePixelRatio, 2);
    if (this.canvas.width !== Math.floor(width * ratio) || this.canvas.height !== Math.floor(height * ratio)) {
      this.renderer.setPixelRatio(ratio);
      this.renderer.setSize(width, height);
      this.camera.aspect = width / height;
      this.camera.updateProjectionMatrix();
    }
    const { centre, orbit: { distance, turn, tilt } } = this;
    this.camera.position.set(centre.x + distance * Math.cos(tilt) * Math.cos(turn), centre.y + distance * Math.cos(tilt) * Math.sin(turn), centre.z + distance * Math.sin(tilt));
    this.camera.lookAt(centre);
    this.#pose(values, "group");
    this.#fade(this.joints.length > 0 && !values.some(Number.isFinite));
    const isApart = this.ghost.checked && values.some((each, i) =>
      Math.abs(each - targets[i]) > (this.joints[i].type === "prismatic" ? NEAR_SLIDE : NEAR));
    for (const link of this.links.values()) if (!link.parent) link.ghost.visible = isApart;
    if (isApart) this.#pose(targets.map((each, i) => (Number.isFinite(each) ? each : values[i])), "ghost");
    this.joints.forEach((joint, i) => joint.show(values[i]));
    this.renderer.render(this.scene, this.camera);
    this.frames++;
    return true;
  }
}

// The value of a signal at a place; NaN if there is none.
function valueOf(store, name, at) {
  const column = name && store.column(name);
  return column && !store.empty ? column.get(at) : NaN;
}
