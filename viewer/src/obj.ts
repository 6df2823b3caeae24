/**
 * Reader of OBJ files as `artgs export` writes them. It reads bytes, not lines: files have tens of megabytes.
 *
 * Limitations: one object, one material, no relative indices; polygons become fans.
 *
 * Comments `# evidence KIND` before faces become groups of the geometry: the index of the material is that in `EVIDENCE`.
 */

import { BufferAttribute, BufferGeometry, Color, SRGBColorSpace } from "three";

const NEWLINE = 10;
const SPACE = 32;
const SLASH = 47;
const HASH = 35;

/** What faces rest on: a sensor measured them; photos and surfaces that continue; nothing. */
export const EVIDENCE = ["seen", "derived", "invented"] as const;
const MARK = "# evidence ";

class Numbers {
  data: Float32Array;
  length = 0;
  constructor(room: number) {
    this.data = new Float32Array(room);
  }
  push(value: number): void {
    if (this.length === this.data.length) {
      const wider = new Float32Array(this.data.length * 2);
      wider.set(this.data);
      this.data = wider;
    }
    this.data[this.length++] = value;
  }
}

/** A geometry with positions and, where the file has them, normals, texture coordinates and colours. */
export function parseObj(source: Uint8Array): BufferGeometry {
  const positions = new Numbers(1 << 12);
  const colours = new Numbers(1 << 12);
  const normals = new Numbers(1 << 12);
  const coordinates = new Numbers(1 << 12);
  /** Three indices per corner from 0: position, texture coordinate, normal; -1 where there is none. */
  const corners: number[] = [];
  const polygon: number[] = [];
  /** Corners from which on faces rest on something else. */
  const marks: { from: number; kind: number }[] = [];
  const end = source.length;
  let at = 0;

  const blank = () => {
    while (at < end && source[at] <= SPACE && source[at] !== NEWLINE) at++;
    return at < end && source[at] !== NEWLINE;
  };
  const number = (): number => {
    const from = at;
    let digits = 0;
    let scale = 0;
    let plain = true;
    let value = 0;
    const negative = source[at] === 45;
    if (negative || source[at] === 43) at++;
    for (let point = false; at < end && source[at] > SPACE && source[at] !== SLASH; at++) {
      const c = source[at];
      if (c >= 48 && c <= 57) {
        value = value * 10 + (c - 48);
        digits++;
        if (point) scale++;
      } else if (c === 46 && !point) point = true;
      else plain = false;
    }
    // Numbers with an exponent or with more digits than a double holds are parsed by `Number`.
    if (!plain || digits > 15) return Number(new TextDecoder().decode(source.subarray(from, at)));
    if (digits === 0) throw new Error(`byte ${from} of the OBJ is not a number`);
    value /= 10 ** scale;
    return negative ? -value : value;
  };

  while (at < end) {
    if (blank()) {
      const [c, next] = [source[at], source[at + 1]];
      if (c === 118 && next === SPACE) {
        at++;
        for (let i = 0; blank(); i++) (i < 3 ? positions : colours).push(number());
      } else if (c === 118 && (next === 110 || next === 116)) {
        at += 2;
        const [into, most] = next === 110 ? [normals, 3] : [coordinates, 2];
        for (let i = 0; blank(); i++) {
          const value = number();
          if (i < most) into.push(value);
        }
      } else if (c === 102 && next === SPACE) {
        at++;
        polygon.length = 0;
        while (blank()) {
          for (let part = 0; part < 3; part++) {
            let index = 0;
            if (part === 0 || source[at] === SLASH) {
              if (part > 0) at++;
              if (at < end && source[at] > SLASH) index = number();
            }
            polygon.push(index - 1);
          }
        }
        for (let k = 6; k + 2 < polygon.length; k += 3) {
          for (const from of [0, k - 3, k]) corners.push(polygon[from], polygon[from + 1], polygon[from + 2]);
        }
      } else if (c === HASH) {
        const line = new TextDecoder().decode(source.subarray(at, source.indexOf(NEWLINE, at)));
        const kind = line.startsWith(MARK) ? EVIDENCE.indexOf(line.slice(MARK.length) as (typeof EVIDENCE)[number]) : -1;
        if (kind >= 0) marks.push({ from: corners.length / 3, kind });
      }
    }
    while (at < end && source[at] !== NEWLINE) at++;
    at++;
  }
  const geometry = assemble(positions, colours, normals, coordinates, corners);
  marks.forEach(({ from, kind }, i) => geometry.addGroup(from, (marks[i + 1]?.from ?? corners.length / 3) - from, kind));
  return geometry;
}

function assemble(positions: Numbers, colours: Numbers, normals: Numbers, uvs: Numbers, corners: number[]): BufferGeometry {
  const geometry = new BufferGeometry();
  const count = positions.length / 3;
  const has = { colour: colours.length === positions.length && count > 0, normal: normals.length > 0, uv: uvs.length > 0 };
  let simple = true;
  for (let k = 0; k < corners.length && simple; k += 3) {
    const [p, t, n] = [corners[k], corners[k + 1], corners[k + 2]];
    simple = (t === p || !has.uv) && (n === p || !has.normal);
  }
  simple &&= (!has.normal || normals.length === positions.length) && (!has.uv || uvs.length / 2 === count);
  const corner = (k: number, part: number) => {
    const index = corners[k + part];
    const known = (part === 0 ? positions.length / 3 : part === 1 ? uvs.length / 2 : normals.length / 3) > index;
    if (index < 0 || !known) throw new Error("a face of the OBJ has a corner that is not in the file");
    return index;
  };
  const put = (name: string, values: Numbers, size: number, part: number) => {
    if (simple) return geometry.setAttribute(name, new BufferAttribute(values.data.slice(0, values.length), size));
    const out = new Float32Array((corners.length / 3) * size);
    for (let k = 0, o = 0; k < corners.length; k += 3) {
      const from = corner(k, part) * size;
      for (let i = 0; i < size; i++) out[o++] = values.data[from + i];
    }
    return geometry.setAttribute(name, new BufferAttribute(out, size));
  };
  put("position", positions, 3, 0);
  if (has.normal) put("normal", normals, 3, 2);
  if (has.uv) put("uv", uvs, 2, 1);
  if (has.colour) {
    // Vertex colours are sRGB, shaders need linear colours.
    const colour = new Color();
    for (let i = 0; i < colours.length; i += 3) {
      colour.setRGB(colours.data[i], colours.data[i + 1], colours.data[i + 2], SRGBColorSpace);
      colour.toArray(colours.data, i);
    }
    put("color", colours, 3, 0);
  }
  if (simple) {
    const index = new Uint32Array(corners.length / 3);
    for (let k = 0; k < corners.length; k += 3) index[k / 3] = corner(k, 0);
    geometry.setIndex(new BufferAttribute(index, 1));
  }
  if (!has.normal) geometry.computeVertexNormals();
  geometry.computeBoundingBox();
  geometry.computeBoundingSphere();
  return geometry;
}
