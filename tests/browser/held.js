// Record whether the box is there in each drawing of viser's scene; CALL is replaced by a test.
window.drawings = [];
// After the harness has defined the same property, and before viser's program runs.
addEventListener("DOMContentLoaded", () => {
    const before = Object.getOwnPropertyDescriptor(window, "__viserMutable");
    let mine;
    Object.defineProperty(window, "__viserMutable", {
        configurable: true,
        get: () => mine,
        set(value) {
            before.set(mine = value);
            const { gl } = value.scene.__r3f.root.getState();
            const render = gl.render;
            gl.render = (scene, camera) => {
                const there = Boolean(value.nodeRefFromName["/box"]);
                if (scene === value.scene) drawings.push(there);
                render.call(gl, scene, camera);
            };
        },
    });
    CALL
});
