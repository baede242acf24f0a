// The text of the lesson that the run belongs to, beside the map.

const ITEMS = /\n(?=(?:-|\d+\.) )/;

/** Fetch the lesson's text into `box`. Whether the run belongs to a lesson. */
export async function loadLesson(box) {
  const reply = await fetch("lesson.md");
  const text = reply.ok ? await reply.text() : "";
  box.replaceChildren(...text.trim().split(/\n{2,}/).filter(Boolean).map(made));
  return text !== "";
}

/** The element of a block of Markdown: heading, code, list or paragraph. */
function made(block) {
  if (block.startsWith("# ")) return filled("h2", block.slice(2));
  if (/^( {4}|```)/.test(block)) {
    const code = document.createElement("pre");
    code.textContent = block.replace(/^```.*\n?/gm, "").replace(/^ {4}/gm, "");
    return code;
  }
  const items = block.split(ITEMS).map((item) => /^(?:-|\d+\.) ([^]*)/.exec(item)?.[1]);
  if (!items[0]) return filled("p", block);
  const list = document.createElement(block.startsWith("-") ? "ul" : "ol");
  list.append(...items.map((item) => filled("li", item)));
  return list;
}

/** An element with a text, in which `code` is between backquotes. */
function filled(tag, text) {
  const element = document.createElement(tag);
  text.split("`").forEach((part, number) => {
    if (number % 2) element.append(filled("code", part));
    else element.append(part);
  });
  return element;
}
