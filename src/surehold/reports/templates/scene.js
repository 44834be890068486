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
  const scene = new THREE.Scene();
  const camera = new THREE.PerspectiveCamera(36, 1, 0.001, 100);
  camera.up.set(0, 0, 1);
  const lamp = new THREE.DirectionalLight(0xffffff, 1.9);
  scene.add(new THREE.HemisphereLight(0xffffff, 0x8c8c99, 1.7), lamp);

  const solids = data.meshes.map((mesh) => {
    let geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(bytes(mesh.vertices)), 3));
    geometry.setIndex(new THREE.BufferAttribute(new Uint32Array(bytes(mesh.faces)), 1));
    geometry = THREE.toCreasedNormals(geometry, 0.6);
    const material = new THREE.MeshStandardMaterial({ color: mesh.color, roughness: 0.65, metalness: 0, side: THREE.DoubleSide });
    const solid = new THREE.Mesh(geometry, material);
    solid.visible = false;
    scene.add(solid);
    if (mesh.see_through) {
      // Depth first, color after: of a half transparent solid only its nearest surface is blended.
      const depth = new THREE.Mesh(geometry, new THREE.MeshBasicMaterial({ colorWrite: false, transparent: true }));
      depth.renderOrder = 2;
      solid.userData.depth = depth;
      scene.add(depth);
    }
    return solid;
  });

  const span = new THREE.Box3();
  data.views.forEach((view) => view.meshes.forEach((i) => span.expandByObject(solids[i])));
  const middle = span.getCenter(new THREE.Vector3());
  const radius = span.getSize(new THREE.Vector3()).length() / 2 || 1;

  const marks = data.views.map((view) => {
    const cones = new THREE.Group(), dots = new THREE.Group(), box = new THREE.Group();
    const length = 0.17 * radius;
    view.contacts.forEach((contact) => {
      const point = new THREE.Vector3(...contact.p), normal = new THREE.Vector3(...contact.n).normalize();
      const share = 0.35 + 0.65 * contact.w;
      const dot = new THREE.Mesh(new THREE.SphereGeometry(0.016 * radius, 20, 14),
        new THREE.MeshBasicMaterial({ color: "#e8384f" }));
      dot.position.copy(point);
      dots.add(dot);
      const wide = Math.max(contact.mu, 0.02) * length * share;
      const cone = new THREE.Mesh(new THREE.ConeGeometry(wide, length * share, 40, 1, true),
        new THREE.MeshStandardMaterial({ color: "#f2b705", transparent: true, opacity: 0.25 + 0.5 * contact.w,
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
    scene.add(cones, dots, box);
    return { cones, dots, box };
  });

  let current = data.views.length - 1;
  const controls = new THREE.OrbitControls(camera, renderer.domElement);
  const draw = () => {
    lamp.position.copy(camera.position).add(new THREE.Vector3(0.3 * radius, 0.2 * radius, 1.2 * radius));
    renderer.render(scene, camera);
  };
  const shown = (what) => { const input = document.querySelector(`[data-show="${what}"]`); return !input || input.checked; };
  const boxShown = () => { const input = document.querySelector('[data-show="box"]'); return Boolean(input && input.checked); };

  const update = () => {
    scene.background = new THREE.Color(color("--scene"));
    const view = data.views[current];
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
      mark.dots.visible = i === current;
      mark.cones.visible = i === current && shown("cones");
      mark.box.visible = i === current && boxShown();
    });
    document.querySelectorAll("[data-view]").forEach((button) =>
      button.setAttribute("aria-pressed", String(Number(button.dataset.view) === current)));
    note.textContent = view.note;
    renderer.domElement.setAttribute("aria-label", `3-D view of the grasp: ${view.label}. ${view.note}`);
    draw();
  };
  const reset = () => {
    const aspect = stage.clientWidth / stage.clientHeight;
    const distance = 1.12 * radius / Math.sin(halfAngle(aspect));
    camera.position.copy(middle).addScaledVector(new THREE.Vector3(...data.views[current].view).normalize(), distance);
    controls.target.copy(middle);
    controls.update();
    draw();
  };
  function halfAngle(aspect) {
    const vertical = camera.fov * Math.PI / 360;
    return aspect >= 1 ? vertical : Math.atan(Math.tan(vertical) * aspect);
  }
  const resize = () => {
    const width = stage.clientWidth, height = stage.clientHeight;
    if (!width || !height) return;
    renderer.setSize(width, height, false);
    camera.aspect = width / height;
    camera.near = radius / 100;
    camera.far = radius * 30;
    camera.updateProjectionMatrix();
    draw();
  };
  controls.addEventListener("change", draw);
  document.querySelectorAll("[data-view]").forEach((button) => button.addEventListener("click", () => {
    current = Number(button.dataset.view);
    update();
  }));
  document.querySelectorAll("[data-show]").forEach((input) => input.addEventListener("change", update));
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
