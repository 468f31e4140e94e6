"use strict";
// The search of the guide. `GUIDE` has one entry per heading and per key: [address, page or table, heading, text].
// `POINTS` has the points of a word by its place. `gusset guide WORD` searches in the same way.

/// The entries in which every word occurs, best first: a word in the heading counts most, then one in the page's title.
function searched(guide, query) {
  const words = query.toLowerCase().split(/\s+/).filter((word) => word !== "");
  if (words.length === 0) {
    return [];
  }
  const found = [];
  for (const [address, page, heading, text] of guide) {
    const [inPage, inHeading, inText] = [page, heading, text].map((part) => part.toLowerCase());
    let score = 0;
    for (const word of words) {
      let points = inText.includes(word) ? POINTS.text : 0;
      points += inPage.includes(word) ? POINTS.page : 0;
      points += inHeading.includes(word) ? POINTS.heading : 0;
      points += inHeading === word ? POINTS.whole : 0;
      if (points === 0) {
        score = 0;
        break;
      }
      score += points;
    }
    if (score > 0) {
      found.push({ address, page, heading, text: snippet(text, words), score });
    }
  }
  return found.sort((a, b) => b.score - a.score);
}

/// About 200 characters of the text around the first word that occurs in it.
function snippet(text, words) {
  const lower = text.toLowerCase();
  const places = words.map((word) => lower.indexOf(word)).filter((at) => at >= 0);
  const first = places.length === 0 ? 0 : Math.min(...places);
  let from = Math.max(0, first - 60);
  if (from > 0) {
    const blank = text.indexOf(" ", from);
    from = blank < 0 || blank > first ? from : blank + 1;
  }
  const piece = text.slice(from, from + 200);
  return (from > 0 ? "… " : "") + piece + (from + 200 < text.length ? " …" : "");
}

/// Adds the text to an element, with the words marked.
function addMarked(element, text, words) {
  const lower = text.toLowerCase();
  let at = 0;
  while (at < text.length) {
    let next = -1;
    let length = 0;
    for (const word of words) {
      const place = lower.indexOf(word, at);
      if (place >= 0 && (next < 0 || place < next || (place === next && word.length > length))) {
        next = place;
        length = word.length;
      }
    }
    if (next < 0) {
      break;
    }
    element.append(text.slice(at, next));
    const mark = document.createElement("mark");
    mark.textContent = text.slice(next, next + length);
    element.append(mark);
    at = next + length;
  }
  element.append(text.slice(at));
}

/// Shows the entries that were found instead of the page.
function show(query) {
  const place = document.getElementById("found");
  const page = document.querySelector("article");
  const words = query.toLowerCase().split(/\s+/).filter((word) => word !== "");
  const most = 40;
  place.replaceChildren();
  place.hidden = words.length === 0;
  page.hidden = words.length !== 0;
  if (words.length === 0) {
    return;
  }
  const found = searched(GUIDE, query);
  const count = document.createElement("p");
  count.className = "count";
  count.textContent = found.length === 0
    ? "Nothing found. Try fewer or shorter words."
    : `${found.length} found` + (found.length > most ? `, the first ${most} are shown` : "");
  place.append(count);
  for (const { address, page: title, heading, text } of found.slice(0, most)) {
    const link = document.createElement("a");
    link.href = address;
    const head = document.createElement("b");
    addMarked(head, heading, words);
    const where = document.createElement("span");
    where.textContent = title === heading ? "" : title;
    const piece = document.createElement("p");
    addMarked(piece, text, words);
    link.append(head, " ", where, piece);
    link.addEventListener("click", () => {
      document.getElementById("search").value = "";
      show("");
    });
    place.append(link);
  }
}

if (typeof document !== "undefined") {
  const box = document.getElementById("search");
  box.hidden = false;
  box.addEventListener("input", () => show(box.value));
  box.addEventListener("keydown", (event) => {
    if (event.key === "Escape") {
      box.value = "";
      show("");
    } else if (event.key === "Enter") {
      document.querySelector("#found a")?.click();
    }
  });
  document.addEventListener("keydown", (event) => {
    if (event.key === "/" && document.activeElement !== box) {
      event.preventDefault();
      box.focus();
    }
  });
}
