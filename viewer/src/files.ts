/** Files of the scene: from the server, or from elements of an exported page. Data for the server. */

const inlined = new Map<string, Element>();
for (const element of document.querySelectorAll("script[data-file]")) {
  inlined.set(element.getAttribute("data-file")!, element);
}

/** True in a page that was written by `artgs view --export`. */
export const exported = inlined.size > 0;

/** Bytes of a file of the scene, or of `scene.json`. */
export async function bytes(name: string): Promise<Uint8Array<ArrayBuffer>> {
  const element = inlined.get(name);
  if (element) {
    const packed = atob(element.textContent!);
    const gzip = new Uint8Array(packed.length);
    for (let i = 0; i < packed.length; i++) gzip[i] = packed.charCodeAt(i);
    const stream = new Blob([gzip]).stream().pipeThrough(new DecompressionStream("gzip"));
    return new Uint8Array(await new Response(stream).arrayBuffer());
  }
  if (exported) throw new Error(`${name} is not in this page`);
  const answer = await fetch(name === "scene.json" ? name : `files/${name}`);
  if (!answer.ok) throw new Error(`${name}: ${(await answer.text()).trim()}`);
  return new Uint8Array(await answer.arrayBuffer());
}

export async function text(name: string): Promise<string> {
  return new TextDecoder().decode(await bytes(name));
}

/** A URL under which an element or a loader can load a file. */
export async function address(name: string): Promise<string> {
  const type = name.endsWith(".png") ? "image/png" : "image/jpeg";
  return URL.createObjectURL(new Blob([await bytes(name)], { type }));
}

/** Why the server refused the data; null if it accepted. */
export async function post(path: string, data: object): Promise<string | null> {
  const headers = { "Content-Type": "application/json" };
  try {
    const answer = await fetch(path, { method: "POST", headers, body: JSON.stringify(data) });
    // Read the whole answer: leaving the page earlier would break the connection.
    const words = (await answer.text()).trim();
    return answer.ok ? null : words;
  } catch (error) {
    return error instanceof Error ? error.message : String(error);
  }
}
