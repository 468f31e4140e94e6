// Labels of pictures.

/** Pairs of texts of one picture that lie on each other. */
export const overlaps = (page) =>
  page.$$eval("svg.chart", (pictures) =>
    pictures.flatMap((picture) => {
      const seen = [...picture.querySelectorAll("text")].map((text) => [text.textContent.trim(), text.getBoundingClientRect()]);
      const texts = seen.filter(([, box]) => box.width > 0);
      return texts.flatMap(([words, a], i) =>
        texts
          .slice(i + 1)
          .filter(([, b]) => {
            const across = Math.min(a.right, b.right) - Math.max(a.left, b.left);
            const down = Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
            // Boxes of letters have some air at the top and at the bottom.
            return across > 1 && down > 0.35 * Math.min(a.height, b.height);
          })
          .map(([other]) => `${words} | ${other}`),
      );
    }),
  );
