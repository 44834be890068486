// Figures of a page: the numbers of a trial beside the pointer, and a closer look.
"use strict";
(() => {
  const tip = document.createElement("div");
  tip.className = "tip";
  tip.hidden = true;
  document.body.append(tip);
  for (const svg of document.querySelectorAll("figure svg")) {
    const whole = svg.getAttribute("viewBox").split(/[ ,]+/).map(Number);
    let view = [...whole];
    const texts = new Map();
    for (const title of svg.querySelectorAll("title")) {
      texts.set(title.parentNode, title.textContent);
      title.remove(); // the browser's own hint would come late, and twice
    }
    const show = (next) => {
      view = [
        Math.min(Math.max(next[0], whole[0]), whole[0] + whole[2] - next[2]),
        Math.min(Math.max(next[1], whole[1]), whole[1] + whole[3] - next[3]),
        next[2],
        next[3],
      ];
      svg.setAttribute("viewBox", view.join(" "));
      svg.classList.toggle("closer", view[2] < whole[2]);
    };
    svg.addEventListener("pointermove", (event) => {
      const text = texts.get(event.target);
      tip.hidden = text === undefined;
      if (text !== undefined) {
        tip.textContent = text;
        const left = Math.min(event.pageX + 14, document.documentElement.clientWidth - tip.offsetWidth - 8);
        tip.style.left = `${Math.max(left, 0)}px`;
        tip.style.top = `${event.pageY + 14}px`;
      }
      if (event.buttons === 1 && view[2] < whole[2]) {
        const scale = view[2] / svg.clientWidth;
        show([view[0] - event.movementX * scale, view[1] - event.movementY * scale, view[2], view[3]]);
      }
    });
    svg.addEventListener("pointerleave", () => { tip.hidden = true; });
    svg.addEventListener("dblclick", (event) => {
      event.preventDefault();
      const size = event.shiftKey ? 1 : Math.max(view[2] / whole[2] / 2, 1 / 16);
      const box = svg.getBoundingClientRect();
      const place = [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
      const at = [view[0] + place[0] * view[2], view[1] + place[1] * view[3]];
      show([at[0] - place[0] * size * whole[2], at[1] - place[1] * size * whole[3], size * whole[2], size * whole[3]]);
    });
  }
})();
