// Buttons and forms: each sends one request to the server.

import { $, element } from "./words.js";

const SETTINGS = {
  outlier_rejection: "reject outliers", change_detector: "detect changes",
  forgetting_factor: "forgetting factor", damping: "damper", memory: "memory", stiffness_drift: "stiffness drift",
  dissipation_drift: "dissipation drift", exponent_drift: "exponent drift",
};
const HINTS = {
  change_detector: "In slow noise (AR(1) 0.9 to 0.99) it misses small changes: of damping + 10 % 29 to 97 %, "
    + "of damping + 20 % up to 53 %, of stiffness + 5 % of a soft sponge up to 56 %; none of stiffness + 10 % or damping + 50 %.",
};
const OFFERS = { material: "Material", motion: "Motion", change: "Sudden change to" };

export class Controls {
  constructor({ ask, onPause, onDownload }) {
    this.ask = ask;
    this.methods = {};
    this.choices = {};
    this.offered = "";
    this.shown = "";
    $("hold").onclick = () => ask(pressed("hold") ? "resume" : "hold");
    $("reset").onclick = () => ask("reset");
    this.contact = "";
    const tare = () => { if ($("seconds").reportValidity()) ask("tare", { seconds: Number($("seconds").value) }); };
    const question = $("tare-question");
    $("tare").onclick = () => {
      if (!this.contact) { tare(); return; }
      $("tare-words").textContent = this.contact;
      question.showModal();
    };
    $("tare-now").onclick = () => { question.close(); tare(); };
    $("tare-cancel").onclick = () => question.close();
    $("record").onclick = () => ask("record", { on: !pressed("record") });
    $("pause").onclick = () => {
      press("pause", !pressed("pause"));
      $("pause").textContent = pressed("pause") ? "Resume view" : "Pause view";
      onPause(pressed("pause"));
    };
    $("download").onclick = onDownload;
    $("method").onchange = () => this.showSettings(this.methods[$("method").value]);
    $("estimator").onsubmit = (event) => { event.preventDefault(); this.start(); };
    $("view").onsubmit = (event) => {
      event.preventDefault();
      if ($("depth").value) ask("depth", { value: Number($("depth").value) / 1000 });
    };
    $("median").onclick = () => ask("depth", { value: null });
  }

  hello(methods, choices = {}) {
    this.methods = methods;
    this.choices = choices;
    this.shown = "";
    $("method").replaceChildren(...Object.keys(methods).map((name) => element("option", { value: name }, name)));
  }

  showSettings(settings = {}) {
    $("settings").replaceChildren(...Object.entries(settings).map(([name, value]) => {
      const label = SETTINGS[name] ?? name.replaceAll("_", " ");
      if (typeof value === "boolean") {
        const box = element("input", { type: "checkbox", name, checked: value });
        return element("label", { title: HINTS[name] ?? "" }, box, ` ${label}`);
      }
      if (this.choices[name]) {
        const list = element("select", { name }, ...this.choices[name].map((each) => element("option", { value: each }, each)));
        list.value = value;
        return element("label", {}, `${label} `, list);
      }
      const box = element("input", { type: "number", name, step: "any", min: "0", value: value ?? "" });
      if (name === "forgetting_factor") Object.assign(box, { max: "1", placeholder: "default" });
      return element("label", {}, `${label} `, box);
    }));
  }

  start() {
    const options = { method: $("method").value };
    for (const box of $("settings").querySelectorAll("input, select")) {
      if (box.tagName === "SELECT") options[box.name] = box.value;
      else if (box.type === "checkbox") options[box.name] = box.checked;
      else if (box.value !== "") options[box.name] = Number(box.value);
      else if (box.name === "forgetting_factor") options[box.name] = null;
    }
    this.ask("estimator", options);
  }

  /** Show the running settings, except in a control that the user is editing. */
  show(page) {
    const { loop, others, depth } = page;
    this.contact = page.facts["tare-warning"] ?? "";
    press("hold", loop.held);
    $("hold").textContent = loop.held ? "Resume" : "Hold";
    const { recorder } = others;
    $("record").disabled = !recorder;
    $("record").title = recorder ? "" : "palpate live runs without a recorder";
    const recording = Boolean(recorder?.on);
    press("record", recording);
    $("record").textContent = recording ? "Stop recording" : "Record";
    const running = JSON.stringify([loop.method, loop.settings]);
    if (running !== this.shown && loop.method && !$("estimator").contains(document.activeElement)) {
      this.shown = running;
      $("method").value = loop.method;
      this.showSettings(loop.settings);
    }
    if (document.activeElement !== $("depth") && depth.value) {
      $("depth").value = Number((1000 * depth.value).toPrecision(4));
    }
    this.showOffers(loop.offers ?? {});
    for (const list of $("offers").querySelectorAll("select[name]")) {
      const chosen = loop.chosen?.[list.name];
      if (chosen && list !== document.activeElement) list.value = chosen;
    }
  }

  showOffers(offers) {
    const text = JSON.stringify(offers);
    if (text === this.offered) return;
    this.offered = text;
    const made = Object.entries(offers).map(([name, values]) => {
      const label = OFFERS[name] ?? name;
      const list = element("select", {}, ...values.map((value) => element("option", { value }, value)));
      if (name === "change") { // acts at once, so only on a click
        const act = () => this.ask("source", { change: list.value });
        return element("span", {}, element("label", {}, `${label} `, list), " ",
          element("button", { type: "button", onclick: act }, "Change now"));
      }
      list.name = name;
      list.onchange = () => this.ask("source", { [name]: list.value });
      return element("label", {}, `${label} `, list);
    });
    $("offers").replaceChildren(...made, element("span", { id: "truth", className: "soft" }));
    $("offers").hidden = !made.length;
  }
}

const pressed = (id) => $(id).getAttribute("aria-pressed") === "true";
const press = (id, on) => $(id).setAttribute("aria-pressed", String(Boolean(on)));
