/** The used functions of meshoptimizer, which three.js contains without types. */
declare module "three/addons/libs/meshopt_simplifier.module.js" {
  export const MeshoptSimplifier: {
    supported: boolean;
    ready: Promise<void>;
    /** Indices of about `target` corners, and the error relative to the extent. */
    simplify(indices: Uint32Array, positions: Float32Array, stride: number, target: number, error: number, flags: ("Permissive" | "Prune")[]): [Uint32Array, number];
  };
}
