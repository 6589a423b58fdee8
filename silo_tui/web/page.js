// the terminal takes the keys from the start, and all of them: F1 and F2 are the browser's elsewhere
window.addEventListener("load", () => {
  const focus = () => document.querySelector(".xterm-helper-textarea")?.focus();
  new MutationObserver(focus).observe(document.body, { attributes: true, attributeFilter: ["class"] });
  document.body.addEventListener("click", focus);
  window.addEventListener("keydown", (event) => /^F\d+$/.test(event.key) && event.preventDefault(), true);
});
