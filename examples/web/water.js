// The module water.wasm as an object: opens a tank, runs it, reads its particles. SPDX-License-Identifier: MIT

// What a WebAssembly module of C asks of a system it never uses: no files, no clock, no exit.
const nothing = () => 0;
const system = {
    wasi_snapshot_preview1: new Proxy({}, { get: () => nothing, has: () => true }),
    env: new Proxy({}, { get: () => nothing, has: () => true }),
};

/** wasm: an ArrayBuffer or a Response with the bytes of water.wasm. */
export async function loadWater(wasm) {
    const { instance } = await WebAssembly.instantiate(wasm, system);
    const c = instance.exports;
    c._initialize?.();

    const text = pointer => {
        const bytes = new Uint8Array(c.memory.buffer, pointer);
        return new TextDecoder().decode(bytes.slice(0, bytes.indexOf(0)));
    };
    const check = good => {
        if (!good) throw new Error(text(c.message()));
    };

    return {
        /** model: an ArrayBuffer, the bytes of a 2D model file. Water of columns x rows particles. */
        open(model, columns, rows) {
            const pointer = c.allocate(model.byteLength);
            if (!pointer) throw new Error("no memory for the model");
            new Uint8Array(c.memory.buffer, pointer, model.byteLength).set(new Uint8Array(model));
            const good = c.open(pointer, model.byteLength, columns, rows);
            c.release(pointer);
            check(good);
            return { width: c.width(), height: c.height(), spacing: c.spacing(), timeStep: c.time_step() };
        },
        /** Runs time steps under a gravity, m/s^2. */
        run(steps, gravityX = 0, gravityY = -9.81) {
            check(c.run(steps, gravityX, gravityY));
        },
        /** Positions x, y, x, y ..., m, and speeds, m/s; views that hold until the next call. */
        particles() {
            const count = c.count(), pointer = c.numbers();
            return {
                count,
                positions: new Float32Array(c.memory.buffer, pointer, 2 * count),
                speeds: new Float32Array(c.memory.buffer, pointer + 8 * count, count),
            };
        },
        /** The state in 16 hexadecimal digits: the same on every machine. */
        hash() {
            return [1, 0].map(upper => (c.hash(upper) >>> 0).toString(16).padStart(8, "0")).join("");
        },
    };
}
