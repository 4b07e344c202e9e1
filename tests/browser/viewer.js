// A stock three.js viewer: GLTFLoader, no plug-in, no light, no tone mapping. check.js bundles it into a page.
import * as THREE from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";

const SIDE = 33;

async function open(bytes) {
  const gltf = await new GLTFLoader().parseAsync(Uint8Array.from(atob(bytes), (c) => c.charCodeAt(0)).buffer, "");
  const renderer = new THREE.WebGLRenderer({ preserveDrawingBuffer: true });
  renderer.setSize(SIDE, SIDE, false);
  const scene = new THREE.Scene();
  scene.background = new THREE.Color(0xff00ff);
  scene.add(gltf.scene);
  const meshes = [];
  gltf.scene.traverse((node) => node.isMesh && meshes.push(node));

  window.model = {
    meshes: meshes.map((mesh) => mesh.material.name),
    materials: new Set(meshes.map((mesh) => mesh.material.type)).size,
    textures: new Set(meshes.map((mesh) => mesh.material.map).filter(Boolean)).size,
    triangles: meshes.reduce((n, mesh) => n + mesh.geometry.index.count / 3, 0),
    // The colour a camera sees that stands `distance` before the point `at` and looks straight at it.
    colour({ at, normal, distance }) {
      const camera = new THREE.PerspectiveCamera(1, 1, distance / 4, distance * 4);
      const [x, y, z] = normal;
      camera.up.set(...(Math.abs(y) < 0.9 ? [0, 1, 0] : [1, 0, 0]));
      camera.position.set(at[0] + distance * x, at[1] + distance * y, at[2] + distance * z);
      camera.lookAt(...at);
      renderer.render(scene, camera);
      const gl = renderer.getContext();
      const pixel = new Uint8Array(4);
      gl.readPixels((SIDE - 1) / 2, (SIDE - 1) / 2, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
      return [...pixel.slice(0, 3)];
    },
  };
}

window.open_model = (bytes) => open(bytes).catch((error) => (window.model_error = String(error?.stack ?? error)));
