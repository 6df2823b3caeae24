/** Short functions that create DOM elements. */

type Child = Node | string;

export function make<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  fields: Partial<HTMLElementTagNameMap[K]> = {},
  ...children: Child[]
): HTMLElementTagNameMap[K] {
  const element = Object.assign(document.createElement(tag), fields);
  element.append(...children);
  return element;
}

export function button(text: string, act: () => void): HTMLButtonElement {
  const element = make("button", { type: "button" }, text);
  element.addEventListener("click", act);
  return element;
}

export function check(text: string, act: (on: boolean) => void): HTMLLabelElement {
  const input = make("input", { type: "checkbox" });
  input.addEventListener("change", () => act(input.checked));
  return make("label", { className: "check" }, input, text);
}

export function section(title: string, ...children: Child[]): HTMLElement {
  return make("section", {}, make("h2", {}, title), ...children);
}
