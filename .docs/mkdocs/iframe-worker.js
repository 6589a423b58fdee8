// Browsers start no worker from a file on the disk. The search is one: there it lives in a hidden frame.
if (location.protocol === "file:") {
  window.Worker = class extends EventTarget {
    constructor(script) {
      super();
      this.frame = document.createElement("iframe");
      this.frame.hidden = true;
      this.begun = new Promise((begin) => {
        this.frame.addEventListener("load", begin, { once: true });
      });
      // in the frame, what the worker says goes to the page
      this.frame.srcdoc = `<!doctype html><script>
        window.postMessage = (said) => parent.postMessage(said, "*");
        window.importScripts = (...scripts) => {
          for (const script of scripts) document.write('<script src="' + script + '"></scr' + 'ipt>');
        };
      </scr` + `ipt><script src="${new URL(script, location.href)}"></scr` + "ipt>";
      const add = () => document.body.append(this.frame);
      document.body ? add() : document.addEventListener("DOMContentLoaded", add, { once: true });
      window.addEventListener("message", (event) => {
        if (event.source === this.frame.contentWindow) this.dispatchEvent(new MessageEvent("message", { data: event.data }));
      });
    }

    async postMessage(data) {
      await this.begun;
      const frame = this.frame.contentWindow;
      frame.dispatchEvent(new frame.MessageEvent("message", { data }));
    }

    terminate() {
      this.frame.remove();
    }
  };
}
