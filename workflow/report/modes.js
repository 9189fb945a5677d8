// Sliders of a cohort's modes: the shape is the mean plus each mode by its slider.
const form = document.getElementById("modes");
const shape = document.querySelector(".viewer");
let moves;

async function bend() {
  const amounts = Array.from(form.querySelectorAll("input"), (slider) => Number(slider.value));
  form.querySelectorAll("output").forEach((place, k) => place.value = amounts[k].toFixed(1));
  if (shape.dataset.state !== "ready") return;
  moves ??= JSON.parse(await inflate(document.getElementById("moves").textContent));
  const axes = moves.mean.map((start, axis) => start.map(
    (value, p) => amounts.reduce((sum, amount, k) => sum + amount * moves.modes[k][axis][p], value)));
  await Plotly.restyle(shape, { x: [axes[0]], y: [axes[1]], z: [axes[2]] }, [0]);
}

form.addEventListener("input", bend);
form.addEventListener("reset", () => setTimeout(bend));
new MutationObserver(bend).observe(shape, { attributeFilter: ["data-state"] });
