// Puts a button beside the command that copies it.
(() => {
  "use strict";
  const text = document.getElementById("command"), button = document.createElement("button");
  button.textContent = "copy";
  button.onclick = async () => {
    try {
      await navigator.clipboard.writeText(text.textContent);
    } catch {
      getSelection().selectAllChildren(text);
      document.execCommand("copy");
    }
    button.textContent = "copied";
    setTimeout(() => { button.textContent = "copy"; }, 1500);
  };
  text.after(button);
})();
