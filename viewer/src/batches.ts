/**
 * Draws many Gaussians per instance. Spark draws one instance of four corners for each Gaussian; software renderers need
 * about 20 microseconds per instance, and graphics cards use only a part of each wave.
 */

import { BufferAttribute, InstancedBufferGeometry } from "three";
import type { SparkRenderer } from "@sparkjsdev/spark";

/** Gaussians per instance. */
const BATCH = 128;
const CORNERS = [-1, -1, 1, -1, 1, 1, -1, 1];
const TRIANGLES = [0, 1, 2, 0, 2, 3];

/** A geometry of `BATCH` quads; `count` receives the number of Gaussians that Spark draws. */
function quads(count: { value: number }): InstancedBufferGeometry {
  const geometry = new InstancedBufferGeometry();
  const corners = Array.from({ length: BATCH }, (_, k) => [0, 1, 2, 3].flatMap((c) => [CORNERS[2 * c], CORNERS[2 * c + 1], k])).flat();
  geometry.setAttribute("position", new BufferAttribute(new Float32Array(corners), 3));
  const index = Array.from({ length: BATCH }, (_, k) => TRIANGLES.map((t) => 4 * k + t)).flat();
  geometry.setIndex(new BufferAttribute(new Uint16Array(index), 1));
  Object.defineProperty(geometry, "instanceCount", {
    get: () => Math.ceil(count.value / BATCH),
    set: (wanted: number) => (count.value = wanted),
  });
  return geometry;
}

/** Call before the first frame. Changes nothing if the shader of Spark is not the known one. */
export function drawInBatches(spark: SparkRenderer): void {
  const { material } = spark;
  const main = "void main() {";
  const known = material.vertexShader.includes(main) && material.vertexShader.includes("gl_InstanceID");
  if (!known || /position\.z|position\.xyz|\bposition\b(?!\.)/.test(material.vertexShader)) return;
  const count = { value: 0 };
  const order = `int gaussian = gl_InstanceID * ${BATCH} + int(position.z);`;
  const beyond = "if (gaussian >= gaussians) { gl_Position = vec4(0.0, 0.0, 2.0, 1.0); return; }";
  material.vertexShader = material.vertexShader
    .replaceAll("gl_InstanceID", "gaussian")
    .replace(main, `uniform int gaussians;\n${main}\n${order}\n${beyond}`);
  material.uniforms.gaussians = count;
  spark.geometry.dispose();
  spark.geometry = quads(count);
}
