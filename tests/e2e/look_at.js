// What a look at a page finds: texts that are hard to read, cut off, or covered.
({
  // Texts whose contrast to what is behind them is less than asked for.
  faint(least) {
    const context = document.createElement("canvas").getContext("2d", { willReadFrequently: true });
    const colour = (text) => {
      context.clearRect(0, 0, 1, 1);
      context.fillStyle = text;
      context.fillRect(0, 0, 1, 1);
      const [r, g, b, a] = context.getImageData(0, 0, 1, 1).data;
      return [r, g, b, a / 255];
    };
    const over = ([r, g, b, a], [R, G, B]) => [r * a + R * (1 - a), g * a + G * (1 - a), b * a + B * (1 - a), 1];
    const channel = (one) => (one <= 0.03928 ? one / 12.92 : ((one + 0.055) / 1.055) ** 2.4);
    const light = ([r, g, b]) => 0.2126 * channel(r / 255) + 0.7152 * channel(g / 255) + 0.0722 * channel(b / 255);
    const paper = (one) => {
      const papers = [];
      for (let outer = one; outer; outer = outer.parentElement) {
        papers.unshift(colour(getComputedStyle(outer).backgroundColor));
      }
      return papers.reduce((below, above) => over(above, below), [255, 255, 255, 1]);
    };
    const unread = ":disabled, .unseen, option, #answer:not(.shown), kbd, label:has(:disabled)";
    const found = [];
    const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
    for (let node = walker.nextNode(); node; node = walker.nextNode()) {
      const one = node.parentElement;
      const words = node.textContent.trim();
      if (!words || !one.getClientRects().length || one.closest(unread)) continue;
      const below = paper(one);
      const lights = [light(below), light(over(colour(getComputedStyle(one).color), below))].sort((a, b) => a - b);
      const ratio = (lights[1] + 0.05) / (lights[0] + 0.05);
      if (ratio < least) found.push(`${words.slice(0, 40)}: ${ratio.toFixed(2)}`);
    }
    return found;
  },

  // Whatever is not seen whole.
  cut() {
    const found = [];
    const kinds = "button, summary, label, b, th, td, p, li, .status, .where, dd";
    for (const one of document.querySelectorAll(kinds)) {
      if (!one.getClientRects().length || one.closest("canvas, .unseen, #answer")) continue;
      const box = one.getBoundingClientRect();
      const hides = getComputedStyle(one).overflowX !== "visible" && one.scrollWidth > one.clientWidth + 1;
      if (box.width > 3 && (hides || box.right > document.documentElement.clientWidth + 1)) {
        found.push(`${one.tagName} ${one.className}: ${one.textContent.trim().slice(0, 50)}`);
      }
    }
    for (const one of document.querySelectorAll("select")) {
      if (!one.getClientRects().length) continue;
      const probe = document.createElement("span");
      probe.textContent = one.selectedOptions[0]?.textContent ?? "";
      Object.assign(probe.style, { position: "absolute", whiteSpace: "nowrap", font: getComputedStyle(one).font });
      document.body.append(probe);
      if (probe.offsetWidth > one.clientWidth - 8) found.push(`select: ${probe.textContent}`);
      probe.remove();
    }
    return found;
  },

  // Parts beside each other of which one lies over the other.
  covered() {
    const places = "header > *, main > *, #stage > :not(#plan-map), #times .head > *, #times .grid > *, #plans > *";
    const parts = [...document.querySelectorAll(places)].map((one) => [one, one.getBoundingClientRect()])
      .filter(([one, box]) => one.getClientRects().length && box.width > 0 && box.height > 0);
    const name = (one) => one.id || one.className || one.tagName;
    const found = [];
    for (const [one, a] of parts) {
      for (const [other, b] of parts) {
        if (one === other || one.parentElement !== other.parentElement) continue;
        const wide = Math.min(a.right, b.right) - Math.max(a.left, b.left);
        const high = Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
        const sticks = a.bottom > innerHeight + 1 && getComputedStyle(one).position === "sticky";
        if (wide > 1 && high > 1 && !sticks) found.push(`${name(one)} over ${name(other)}`);
      }
    }
    return found;
  },
})
