// The theme searches in a Worker, and browsers start none for a page that is opened from a folder (file:). There this one
// runs the same script in a hidden frame. The theme's worker asks for the name IFrameWorker.
if (location.protocol === "file:") {
  window.IFrameWorker = class extends EventTarget {
    constructor(url) {
      super();
      this.onmessage = null;
      const frame = document.createElement("iframe");
      frame.hidden = true;
      frame.srcdoc = "<!doctype html><title>search</title>";
      this.inside = new Promise((resolve, reject) => {
        frame.onload = () => {
          const inner = frame.contentWindow;
          inner.postMessage = (data) => {
            const event = new MessageEvent("message", { data });
            this.dispatchEvent(event);
            this.onmessage?.(event);
          };
          const load = (source) => new Promise((done, failed) => {
            const script = inner.document.createElement("script");
            script.src = new URL(source, location.href).href;
            script.onload = done;
            script.onerror = failed;
            inner.document.body.append(script);
          });
          inner.importScripts = (...sources) => Promise.all(sources.map(load));
          load(url).then(() => resolve(inner), reject);
        };
      });
      document.body.append(frame);
      this.terminate = () => frame.remove();
    }

    postMessage(data) {
      this.inside.then((inner) => inner.dispatchEvent(new MessageEvent("message", { data })));
    }
  };
  window.Worker = window.IFrameWorker;
}
