// The saved view: what the page shows at first, and a file of what it shows now.

// The part of the view Inside for each panel of the dashboard; the map is in the view Drive.
const SECTIONS = { plots: "plot-keys", parameters: "parameters", blocks: "blocks", log: "log" };

/** Show the view with which the server was started, if there is one. */
export async function openSavedView(map, plots, showView) {
  const reply = await fetch("/view.json");
  if (!reply.ok) return; // no session; the page shows that elsewhere
  const { panel, fields, span, place, follows } = await reply.json();
  if (!panel) return;
  plots.choose(fields, span);
  if (place) map.showPart(...place, follows);
  if (!SECTIONS[panel]) return;
  showView("inside");
  document.getElementById(SECTIONS[panel]).scrollIntoView();
}

/** Let the browser save what is shown now. */
export function saveView(map, plots, isInside) {
  const part = map.shownPart();
  const query = new URLSearchParams({ panel: isInside ? "plots" : "map", ...plots.choice(), ...part });
  const link = document.createElement("a");
  link.href = `view.yaml?${query}`;
  link.download = "view.yaml";
  link.click();
}
