// The 3D viewer of report.html: levels of detail that share one set of textures, drawn unlit.
// Bundled once with three.js into viewer.bundle.js; the README beside this file says how.
import {
  Color, LinearFilter, LineBasicMaterial, LineSegments, NearestFilter, PerspectiveCamera, Scene, Texture,
  SRGBColorSpace, WebGLRenderer, WireframeGeometry, DoubleSide, FrontSide, Box3, Vector3, LinearMipmapLinearFilter,
  ClampToEdgeWrapping, RepeatWrapping, MirroredRepeatWrapping,
} from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";

const WRAP = { 33071: ClampToEdgeWrapping, 33648: MirroredRepeatWrapping, 10497: RepeatWrapping };
const model = JSON.parse(document.getElementById("model").textContent);
const box = document.getElementById("viewer");
const canvas = box.querySelector("canvas");
const output = box.querySelector("output");

// One texture object a picture file, whatever number of levels name it.
const shared = new Map();
function sharedTexture(uri, sampler) {
  const key = JSON.stringify([uri, sampler]);
  if (!shared.has(key)) {
    const image = new Image();
    const texture = new Texture(image);
    texture.colorSpace = SRGBColorSpace;
    texture.flipY = false;
    texture.wrapS = WRAP[sampler.wrapS ?? 10497];
    texture.wrapT = WRAP[sampler.wrapT ?? 10497];
    shared.set(key, new Promise((resolve, reject) => {
      image.onload = () => { texture.needsUpdate = true; resolve(texture); };
      image.onerror = () => reject(new Error(`picture ${uri}`));
      image.src = model.textures[uri];
    }));
  }
  return shared.get(key);
}

class SharedTextures {
  constructor(parser) { this.parser = parser; this.name = "SharedTextures"; }
  loadTexture(index) {
    const { textures, images, samplers } = this.parser.json;
    const { source, sampler } = textures[index];
    const uri = images[source].uri;
    return uri in model.textures ? sharedTexture(uri, samplers?.[sampler] ?? {}) : null;
  }
}

async function start() {
  const renderer = new WebGLRenderer({ canvas, antialias: true });
  renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
  const scene = new Scene();
  scene.background = new Color(0x292b2e);
  const camera = new PerspectiveCamera(model.camera.fov, 1, 0.01, 1000);
  const controls = new OrbitControls(camera, canvas);
  controls.enableDamping = false;

  const loader = new GLTFLoader().register((parser) => new SharedTextures(parser));
  const levels = [];
  for (const level of model.levels) levels.push((await loader.parseAsync(level, "")).scene);
  const bounds = new Box3().setFromObject(levels[0]);
  const size = bounds.getSize(new Vector3()).length() || 1;
  camera.near = size / 2000;
  camera.far = size * 20;

  const lines = new LineBasicMaterial({ color: 0x000000, transparent: true, opacity: 0.35 });
  const meshes = levels.map((level) => {
    const found = [];
    level.traverse((node) => { if (node.isMesh) found.push(node); });
    return found;
  });
  const counts = meshes.map((list) => list.reduce((n, m) => n + m.geometry.index.count / 3, 0));
  const state = { level: 0, edges: false, texels: false, backs: false };

  function show() {
    scene.clear();
    scene.add(levels[state.level]);
    for (const mesh of meshes[state.level]) {
      mesh.material.side = state.backs ? DoubleSide : FrontSide;
      const had = mesh.children.find((c) => c.isLineSegments);
      if (state.edges && !had) mesh.add(new LineSegments(new WireframeGeometry(mesh.geometry), lines));
      if (had) had.visible = state.edges;
      const map = mesh.material.map;
      if (map && map.userData.texels !== state.texels) {
        map.userData.texels = state.texels;
        map.magFilter = state.texels ? NearestFilter : LinearFilter;
        map.minFilter = LinearMipmapLinearFilter;
        map.anisotropy = renderer.capabilities.getMaxAnisotropy();
        map.needsUpdate = true;
      }
    }
    for (const button of box.querySelectorAll("button[data-level]")) {
      button.classList.toggle("on", Number(button.dataset.level) === state.level);
    }
    output.textContent = `${counts[state.level].toLocaleString("en")} triangles, ${shared.size} textures`;
    draw();
  }

  function draw() {
    const width = canvas.clientWidth;
    const height = canvas.clientHeight;
    const ratio = renderer.getPixelRatio();
    if (canvas.width !== Math.floor(width * ratio) || canvas.height !== Math.floor(height * ratio)) {
      renderer.setSize(width, height, false);
      camera.aspect = width / height;
      camera.updateProjectionMatrix();
    }
    renderer.render(scene, camera);
  }

  function home() {
    camera.position.set(...model.camera.eye);
    controls.target.set(...model.camera.target);
    controls.update();
    draw();
  }

  box.addEventListener("click", (event) => {
    if (event.target.dataset.level !== undefined) { state.level = Number(event.target.dataset.level); show(); }
    if (event.target.dataset.home !== undefined) home();
  });
  box.addEventListener("change", (event) => { state[event.target.name] = event.target.checked; show(); });
  controls.addEventListener("change", draw);
  new ResizeObserver(draw).observe(canvas);
  home();
  show();
  // For tests: what is drawn, and the colour of a pixel (x right, y down, in CSS pixels of the canvas); in the page's
  // own attributes too, for a browser that only dumps the page.
  const viewer = {
    levels: counts, textures: shared.size,
    pixel(x, y) {
      draw();
      const gl = renderer.getContext();
      const ratio = renderer.getPixelRatio();
      const rgba = new Uint8Array(4);
      gl.readPixels(Math.round(x * ratio), canvas.height - 1 - Math.round(y * ratio), 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, rgba);
      return [...rgba.slice(0, 3)];
    },
  };
  window.viewer = viewer;
  box.dataset.triangles = counts.join(" ");
  box.dataset.textures = shared.size;
  box.dataset.centre = viewer.pixel(canvas.clientWidth / 2, canvas.clientHeight / 2).join(" ");
}

start().catch((error) => { output.textContent = `The 3D view does not start here: ${error.message}`; window.viewerError = String(error); });
