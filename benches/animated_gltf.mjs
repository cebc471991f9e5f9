// Plays motion.glb of `ifg animate --gltf` in three.js, and compares each frame with the point
// caches: for each layer its vertices, frames and the largest difference of a coordinate in metres;
// exit code 1 if one differs.
//
//   npm install --no-save three
//   node benches/animated_gltf.mjs FOLDER
import { readFileSync } from "node:fs";
import { resolve } from "node:path";

globalThis.self = globalThis; // the loader expects a browser
const three = resolve("node_modules/three");
const THREE = await import(`${three}/build/three.module.js`);
const { GLTFLoader } = await import(`${three}/examples/jsm/loaders/GLTFLoader.js`);

const folder = process.argv[2];
const file = readFileSync(`${folder}/motion.glb`);
const bytes = file.buffer.slice(file.byteOffset, file.byteOffset + file.length);
const gltf = await new GLTFLoader().parseAsync(bytes, "");
const mixer = new THREE.AnimationMixer(gltf.scene);
const action = mixer.clipAction(gltf.animations[0]);
action.setLoop(THREE.LoopOnce);
action.clampWhenFinished = true;
const times = gltf.animations[0].tracks[0].times;

let worst = 0;
for (const layer of gltf.scene.children) {
  const cache = readFileSync(`${folder}/${layer.name}.pc2`);
  const points = cache.readInt32LE(16);
  const shown = new THREE.Vector3();
  let largest = 0;
  times.forEach((time, frame) => {
    action.reset().play();
    mixer.setTime(time);
    for (let point = 0; point < points; point++) {
      layer.getVertexPosition(point, shown);
      shown.toArray().forEach((x, axis) => {
        const expected = cache.readFloatLE(32 + 12 * (frame * points + point) + 4 * axis);
        largest = Math.max(largest, Math.abs(x - expected));
      });
    }
  });
  console.log(`${layer.name}: ${points} vertices, ${times.length} frames, difference ${largest} m`);
  worst = Math.max(worst, largest);
}
process.exit(worst > 0 ? 1 : 0);
