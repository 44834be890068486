"use strict";
(() => {
  const data = JSON.parse(document.getElementById("scene-data").textContent);
  const stage = document.getElementById("stage");
  const note = document.getElementById("scene-note");
  const color = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

  let renderer;
  try {
    renderer = new THREE.WebGLRenderer({ antialias: true });
  } catch (error) {
    const text = document.createElement("p");
    text.className = "failure";
    text.textContent = "This browser shows no 3-D graphics (WebGL is off). Everything else on the page is complete.";
    stage.replaceChildren(text);
    return;
  }
  renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
  renderer.domElement.tabIndex = 0;
  renderer.domElement.setAttribute("role", "img");
  stage.append(renderer.domElement);

  const bytes = (key) => Uint8Array.from(atob(data.buffers[key]), (c) => c.charCodeAt(0)).buffer;
  // Normals of a corner: faces around its vertex that bend by less than 35 degrees, weighted by their angle
  // there and their area, so that round bodies look round, flat ones flat, and edges sharp, however they are cut.
  const smooth = (vertices, faces) => {
    const corner = (i) => [vertices[3 * i], vertices[3 * i + 1], vertices[3 * i + 2]];
    const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    const unit = (a) => { const l = Math.hypot(...a) || 1; return [a[0] / l, a[1] / l, a[2] / l]; };
    const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    const around = new Map(), keys = [], normals = [];
    for (let f = 0; f < faces.length; f += 3) {
      const p = [0, 1, 2].map((k) => corner(faces[f + k]));
      const span = cross(minus(p[1], p[0]), minus(p[2], p[0])), area = Math.hypot(...span), normal = unit(span);
      normals.push(normal);
      for (let k = 0; k < 3; k++) {
        const a = unit(minus(p[(k + 1) % 3], p[k])), b = unit(minus(p[(k + 2) % 3], p[k]));
        const key = p[k].map((v) => Math.round(v * 1e6)).join();
        keys.push(key);
        if (!around.has(key)) around.set(key, []);
        around.get(key).push([normal, area * Math.acos(Math.min(Math.max(dot(a, b), -1), 1))]);
      }
    }
    const position = new Float32Array(3 * faces.length), shading = new Float32Array(3 * faces.length);
    for (let i = 0; i < faces.length; i++) {
      const own = normals[Math.floor(i / 3)], sum = [0, 0, 0];
      for (const [normal, weight] of around.get(keys[i])) {
        if (dot(own, normal) > 0.82) for (let k = 0; k < 3; k++) sum[k] += weight * normal[k];
      }
      position.set(corner(faces[i]), 3 * i);
      shading.set(dot(sum, sum) > 0 ? unit(sum) : own, 3 * i);
    }
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(position, 3));
    geometry.setAttribute("normal", new THREE.BufferAttribute(shading, 3));
    return geometry;
  };
  const scene = new THREE.Scene();
  const camera = new THREE.PerspectiveCamera(36, 1, 0.001, 100);
  camera.up.set(0, 0, 1);
  const lamp = new THREE.DirectionalLight(0xffffff, 1.9);
  scene.add(new THREE.HemisphereLight(0xffffff, 0x8c8c99, 1.7), lamp);

  const solids = data.meshes.map((mesh) => {
    const geometry = smooth(new Float32Array(bytes(mesh.vertices)), new Uint32Array(bytes(mesh.faces)));
    const material = new THREE.MeshStandardMaterial({ color: mesh.color, roughness: 0.65, metalness: 0, side: THREE.DoubleSide });
    const solid = new THREE.Mesh(geometry, material);
    solid.visible = false;
    solid.matrixAutoUpdate = false;
    scene.add(solid);
    if (mesh.see_through) {
      // Depth first, color after: of a half transparent solid only its nearest surface is blended.
      const depth = new THREE.Mesh(geometry, new THREE.MeshBasicMaterial({ colorWrite: false, transparent: true }));
      depth.renderOrder = 2;
      depth.matrixAutoUpdate = false;
      solid.userData.depth = depth;
      scene.add(depth);
    }
    return solid;
  });

  // Poses of the meshes of a view, each (k, 3, 4): share 0 is the open hand, share 1 the grasp.
  data.views.forEach((view) => { view.motion = view.poses.map((key) => key && new Float32Array(bytes(key))); });
  const place = (view, share) => view.meshes.forEach((i, n) => {
    const poses = view.motion[n], solid = solids[i];
    if (!poses) return;
    const at = 12 * Math.round(share * (poses.length / 12 - 1));
    solid.matrix.set(...poses.subarray(at, at + 12), 0, 0, 0, 1);
    solid.updateMatrixWorld(true);
    if (solid.userData.depth) { solid.userData.depth.matrix.copy(solid.matrix); solid.userData.depth.updateMatrixWorld(true); }
  });

  const spans = data.views.map((view) => {
    const span = new THREE.Box3();
    [0, 1].forEach((share) => {
      place(view, share);
      view.meshes.forEach((i, n) => {
        const moves = view.motion[n] && view.motion[n].length > 12;
        if (moves || !share) span.expandByObject(solids[i], true);
      });
    });
    return span;
  });
  // A few grasps are compared in one frame; of many to browse each fills the picture.
  const browsing = data.views.length > 4;
  const together = spans.reduce((all, span) => all.union(span), new THREE.Box3());
  const frames = spans.map((span) => browsing ? span : together);
  const radii = frames.map((frame) => frame.getSize(new THREE.Vector3()).length() / 2 || 1);

  const marks = data.views.map((view, i) => {
    const radius = radii[i];
    const cones = new THREE.Group(), dots = new THREE.Group(), box = new THREE.Group();
    const many = view.contacts.length > 24, drawn = [];
    const length = (many ? 0.13 : 0.17) * radius;
    // Heaviest first: of many contacts side by side, one cone is drawn for all, or nothing could be seen.
    [...view.contacts].sort((a, b) => b.w - a.w).forEach((contact) => {
      const point = new THREE.Vector3(...contact.p), normal = new THREE.Vector3(...contact.n).normalize();
      const dot = new THREE.Mesh(new THREE.SphereGeometry((many ? 0.006 + 0.006 * contact.w : 0.016) * radius, 16, 12),
        new THREE.MeshBasicMaterial({ color: "#e8384f" }));
      dot.position.copy(point);
      dots.add(dot);
      if (many && drawn.some((other) => other.distanceTo(point) < 0.2 * radius)) return;
      drawn.push(point);
      const share = 0.35 + 0.65 * contact.w;
      const wide = Math.max(contact.mu, 0.02) * length * share;
      const cone = new THREE.Mesh(new THREE.ConeGeometry(wide, length * share, 40, 1, true),
        new THREE.MeshStandardMaterial({ color: "#ffc400", emissive: "#8a6200", transparent: true, opacity: 0.4 + 0.5 * contact.w,
          side: THREE.DoubleSide, depthWrite: false, roughness: 0.6 }));
      // A cone stands on its base with its tip at +y; here its tip is the contact and it opens along the normal.
      cone.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), normal.clone().negate());
      cone.position.copy(point).addScaledVector(normal, length * share / 2);
      cone.renderOrder = 1;
      cones.add(cone);
    });
    if (view.box) {
      const frame = new THREE.LineSegments(new THREE.EdgesGeometry(new THREE.BoxGeometry(...view.box.size)),
        new THREE.LineBasicMaterial({ color: 0x7a8594 }));
      frame.setRotationFromMatrix(new THREE.Matrix4().makeBasis(...view.box.axes.map((a) => new THREE.Vector3(...a))));
      frame.position.set(...view.box.center);
      box.add(frame);
    }
    const neighbors = new THREE.Group();
    view.neighbors.forEach((neighbor) => {
      // Drawn over everything: these places are mostly inside the object.
      const dot = new THREE.Mesh(new THREE.SphereGeometry((neighbor.bad ? 0.014 : 0.009) * radius, 12, 8),
        new THREE.MeshBasicMaterial({ color: neighbor.bad ? "#d4380d" : "#2f9e6e", depthTest: false, transparent: true, opacity: 0.85 }));
      dot.position.set(...neighbor.p);
      dot.renderOrder = neighbor.bad ? 6 : 5;
      neighbors.add(dot);
    });
    scene.add(cones, dots, box, neighbors);
    return { cones, dots, box, neighbors };
  });

  let current = data.first;
  const controls = new THREE.OrbitControls(camera, renderer.domElement);
  const draw = () => {
    const radius = radii[current];
    lamp.position.copy(camera.position).add(new THREE.Vector3(0.3 * radius, 0.2 * radius, 1.2 * radius));
    renderer.render(scene, camera);
  };
  const shown = (what) => { const input = document.querySelector(`[data-show="${what}"]`); return !input || input.checked; };
  const asked = (what) => { const input = document.querySelector(`[data-show="${what}"]`); return Boolean(input && input.checked); };
  const slider = document.getElementById("closing");

  const update = () => {
    scene.background = new THREE.Color(color("--scene"));
    const view = data.views[current];
    const closed = slider ? Number(slider.value) : 1;
    place(view, closed);
    solids.forEach((solid, i) => {
      solid.visible = view.meshes.includes(i);
      const glass = data.meshes[i].see_through && shown("glass");
      solid.material.transparent = glass;
      solid.material.opacity = glass ? 0.42 : 1;
      solid.material.side = glass ? THREE.FrontSide : THREE.DoubleSide;
      solid.material.needsUpdate = true;
      solid.renderOrder = glass ? 3 : 0;
      if (solid.userData.depth) solid.userData.depth.visible = glass && solid.visible;
    });
    marks.forEach((mark, i) => {
      mark.dots.visible = i === current && closed === 1;
      mark.cones.visible = i === current && closed === 1 && shown("cones");
      mark.box.visible = i === current && asked("box");
      mark.neighbors.visible = i === current && asked("neighbors");
    });
    document.querySelectorAll("[data-view]").forEach((button) =>
      button.setAttribute("aria-pressed", String(Number(button.dataset.view) === current)));
    note.textContent = view.note;
    renderer.domElement.setAttribute("aria-label", `3-D view of the grasp: ${view.label}. ${view.note}`);
    draw();
  };
  const reset = () => {
    // As near as the box around everything allows: each corner must stay inside the picture.
    const back = new THREE.Vector3(...data.views[current].view).normalize();
    const right = new THREE.Vector3(0, 0, 1).cross(back).normalize(), up = back.clone().cross(right);
    const tall = Math.tan(camera.fov * Math.PI / 360), wide = tall * stage.clientWidth / stage.clientHeight;
    const span = frames[current], middle = span.getCenter(new THREE.Vector3());
    let distance = 0;
    for (const x of [span.min.x, span.max.x]) for (const y of [span.min.y, span.max.y]) for (const z of [span.min.z, span.max.z]) {
      const p = new THREE.Vector3(x, y, z).sub(middle);
      distance = Math.max(distance, p.dot(back) + Math.max(Math.abs(p.dot(right)) / wide, Math.abs(p.dot(up)) / tall));
    }
    camera.position.copy(middle).addScaledVector(back, 1.06 * distance);
    controls.target.copy(middle);
    controls.update();
    draw();
  };
  const resize = () => {
    const width = stage.clientWidth, height = stage.clientHeight;
    if (!width || !height) return;
    renderer.setSize(width, height, false);
    camera.aspect = width / height;
    camera.near = Math.min(...radii) / 100;
    camera.far = Math.max(...radii) * 30;
    camera.updateProjectionMatrix();
    draw();
  };
  controls.addEventListener("change", draw);
  document.querySelectorAll("[data-view]").forEach((button) => button.addEventListener("click", () => {
    current = Number(button.dataset.view);
    update();
  }));
  document.querySelectorAll("[data-show]").forEach((input) => input.addEventListener("change", update));
  if (slider) slider.addEventListener("input", update);
  const chooser = document.getElementById("scene-chooser");
  if (chooser) chooser.addEventListener("change", () => { current = Number(chooser.value); update(); if (browsing) reset(); });
  document.getElementById("reset").addEventListener("click", reset);
  renderer.domElement.addEventListener("keydown", (event) => {
    const turn = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1] }[event.key];
    if (!turn) return;
    event.preventDefault();
    const arm = camera.position.clone().sub(controls.target);
    const flat = Math.hypot(arm.x, arm.y), length = arm.length();
    const around = Math.atan2(arm.y, arm.x) + turn[0];
    const up = Math.min(Math.max(Math.atan2(arm.z, flat) - turn[1], -1.5), 1.5);
    camera.position.copy(controls.target).add(new THREE.Vector3(
      length * Math.cos(up) * Math.cos(around), length * Math.cos(up) * Math.sin(around), length * Math.sin(up)));
    controls.update();
    draw();
  });
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", update);
  new ResizeObserver(resize).observe(stage);
  resize();
  reset();
  update();
})();
