// Figures of plotly.js: the library and each figure are inflated when the figure comes into sight.
"use strict";

async function inflate(text) {
  const bytes = Uint8Array.from(atob(text.trim()), (letter) => letter.charCodeAt(0));
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"))).text();
}

let library;
const loadLibrary = () => library ??= inflate(document.getElementById("plotly").textContent).then((source) => {
  document.head.append(Object.assign(document.createElement("script"), { textContent: source }));
});

async function draw(place) {
  try {
    await loadLibrary();
    const { data, layout } = JSON.parse(await inflate(place.querySelector("script").textContent));
    const buttons = [["toImage", "orbitRotation", "tableRotation", "resetCameraDefault3d"]];
    await Plotly.newPlot(place, data, layout, { responsive: true, displaylogo: false, modeBarButtons: buttons });
    place.dataset.state = "ready";
  } catch (error) {
    place.dataset.state = "failed";
    place.append(`The surface cannot be shown here: ${error.message}.`);
  }
}

const sight = new IntersectionObserver((entries) => {
  for (const { isIntersecting, target } of entries) if (isIntersecting) { sight.unobserve(target); draw(target); }
});
for (const place of document.querySelectorAll(".viewer")) sight.observe(place);
