// Elements of the page, made and kept up to date without losing the focus.

/** Make an element: a tag with classes, text, attributes. */
export const make = (tag, text = "", attributes = {}) => {
  const [name, ...classes] = tag.split(".");
  const element = document.createElement(name);
  element.classList.add(...classes);
  element.textContent = text;
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  return element;
};

/** Say something in an element, if it does not say so already. */
export const say = (element, text) => {
  if (element.textContent !== text) element.textContent = text;
};

/** Terms and what they are, in a <dl>. */
export const terms = (list, pairs) => {
  const wanted = pairs.map(([term]) => term).join("\n");
  if (list.dataset.terms !== wanted) {
    list.dataset.terms = wanted;
    list.replaceChildren(
      ...pairs.map(([term]) => {
        const group = make("div");
        group.append(make("dt", term), make("dd"));
        return group;
      }),
    );
  }
  pairs.forEach(([, text], i) => say(list.children[i].lastElementChild, text));
};

/**
 * One child for each item: `begin(item)` makes it, `fill(child, item)` brings it up to date. A child
 * whose key stays is kept, and moved only if it must be: who has the focus does not lose it.
 */
export const keyed = (list, items, key, begin, fill) => {
  const old = new Map([...list.children].map((child) => [child.dataset.key, child]));
  const kept = items.map((item) => {
    const name = String(key(item));
    const child = old.get(name) ?? begin(item);
    child.dataset.key = name;
    old.delete(name);
    fill(child, item);
    return child;
  });
  for (const child of old.values()) child.remove();
  kept.forEach((child, i) => {
    if (list.children[i] !== child) list.insertBefore(child, list.children[i] ?? null);
  });
};
