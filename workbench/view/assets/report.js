// Unpacks a 3D replay when it is asked for, so that the page opens at once.
async function unpack(packed) {
  const bytes = Uint8Array.from(atob(packed), c => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).text();
}
for (const figure of document.querySelectorAll("figure.replay")) {
  const stage = figure.querySelector(".stage"), button = figure.querySelector("button");
  button.addEventListener("click", async () => {
    button.disabled = true;
    try {
      const frame = document.createElement("iframe");
      frame.title = stage.dataset.label;
      frame.srcdoc = await unpack(figure.querySelector("script").textContent.trim());
      stage.classList.add("live");
      stage.append(frame);
      button.remove();
    } catch (problem) {
      button.textContent = "this browser cannot unpack the replay; open the file beside this page";
    }
  });
}
if (location.hash === "#play") document.querySelectorAll("figure.replay button").forEach(b => b.click());
