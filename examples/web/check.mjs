// Runs the tank without a page: node check.mjs FOLDER COLUMNS ROWS STEPS prints the hash and the shortest time of a step.
// SPDX-License-Identifier: MIT
import { readFile } from "node:fs/promises";
import { loadWater } from "./water.js";

const [folder, columns, rows, steps] = process.argv.slice(2);
const read = async name => {
    const bytes = await readFile(`${folder}/${name}`);
    return bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength);
};
const water = await loadWater(await read("water.wasm"));
water.open(await read("water2d.safetensors"), Number(columns), Number(rows));
water.run(20); // compiled and warm
let time = Infinity; // the least of all: other programs may be running
for (let i = 0; i < Number(steps); i++) {
    const begin = performance.now();
    water.run(1);
    time = Math.min(time, performance.now() - begin);
}
console.log(`${water.hash()} ${time.toFixed(3)} ms a step of ${water.particles().count} particles`);
