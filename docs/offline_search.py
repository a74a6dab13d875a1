"""Lets the search of the built pages work when they are opened as files, where browsers start no worker.

Material's offline plugin fetches such a script from another server; this one is in the pages.
"""

from __future__ import annotations

from typing import Any

FETCHED = '<script src="https://unpkg.com/iframe-worker/shim"></script>'
"""The script of another server that the offline plugin puts into each page."""
SCRIPT = """<script>
if (location.protocol === "file:") {
  window.IFrameWorker = window.Worker = class extends EventTarget {
    constructor(url) {
      super();
      const frame = document.createElement("iframe");
      frame.hidden = true;
      document.body.append(frame);
      this.inside = frame.contentWindow;
      this.waiting = [];
      this.inside.postMessage = data => this.dispatchEvent(new MessageEvent("message", {data}));
      const script = this.inside.document.createElement("script");
      script.src = new URL(url, location.href).href;
      script.onload = () => { const sent = this.waiting; this.waiting = null; sent.forEach(data => this.postMessage(data)); };
      script.onerror = () => this.dispatchEvent(new ErrorEvent("error", {message: "cannot load " + url}));
      this.inside.document.head.append(script);
    }
    postMessage(data) {
      if (this.waiting) this.waiting.push(data);
      else this.inside.dispatchEvent(new this.inside.MessageEvent("message", {data}));
    }
  };
}
</script>"""


def on_post_page(output: str, **_: Any) -> str:
    """mkdocs calls this for each page."""
    return output.replace(FETCHED, SCRIPT)


def on_post_template(output_content: str, **_: Any) -> str:
    """mkdocs calls this for each template that is no page."""
    return output_content.replace(FETCHED, SCRIPT)
