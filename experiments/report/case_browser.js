// Draws one scored case, and the same case of a second controller over it. Reads the JSON of #cases:
//   fields    names of what is chosen: controller, system, speed, manoeuvre, arm
//   choices   per field its values; labels: what to show for them, where that differs
//   colours   one per controller
//   metrics   per manoeuvre [{name, unit, meaning}], the order of a draw's values
//   first     the key of the case that is shown first
//   jnd       {dB, deg}: half heights of the band of one just noticeable difference
//   cases     "i.j.k.l.m" (the index of each field's choice) -> {draws: [{values} or {stopped_s}], plot}
(() => {
  const cases = read("cases");
  const browser = document.getElementById("case-browser");
  const form = browser.querySelector("form");
  const plot = browser.querySelector(".plotly-graph-div");
  const caption = browser.querySelector("figcaption");
  const table = browser.querySelector("table");
  const inks = { line: "#1f2933", muted: "#9aa5b1", band: "#e4e7eb" };
  const WORST_CASES = 15;

  const words = (value) => String(value).replaceAll("_", " ");
  const label = (field, k) => (cases.labels[field] ? cases.labels[field][k] : words(cases.choices[field][k]));
  const chosen = () => cases.fields.map((field) => Number(form.elements[field].value));
  const find = (index) => cases.cases[index.join(".")];
  const place = (index) => cases.fields.slice(1).map((field, k) => label(field, index[k + 1])).join(", ");

  function fill(select, options) {
    select.replaceChildren(...options.map(([value, text]) => new Option(text, value)));
  }

  function element(tag, text, attributes = {}) {
    const made = document.createElement(tag);
    made.textContent = text;
    for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
    return made;
  }

  // A case's score is the mean of its draws'; an unstable draw stands before every number.
  function worstOf(controller) {
    const size = (draws) => [draws.filter((draw) => !draw.values).length, mean(draws.filter((d) => d.values).map((d) => d.values[0]))];
    const mean = (values) => (values.length ? values.reduce((a, b) => a + b, 0) / values.length : Infinity);
    return Object.entries(cases.cases)
      .filter(([key]) => Number(key.split(".")[0]) === controller)
      .map(([key, found]) => [key, ...size(found.draws)])
      .sort((a, b) => b[1] - a[1] || b[2] - a[2])
      .slice(0, WORST_CASES)
      .map(([key, unstable, score]) => {
        const many = unstable ? `${unstable} unstable` : `${score.toPrecision(3)} JND`;
        return [key, `${many}: ${place(key.split(".").map(Number))}`];
      });
  }

  // Curves of one plot: [x, y, axis row, is it the reference].
  function curvesOf(data) {
    if (data.ratio_dB) return [[data.frequency_Hz, data.ratio_dB, 1, false], [data.frequency_Hz, data.ratio_deg, 2, false]];
    if (data.time_s) {
      const count = data.achieved.length, [first, last] = data.time_s;
      const time = data.achieved.map((_, k) => first + ((last - first) * k) / Math.max(count - 1, 1));
      return [[time, data.reference, 1, true], [time, data.achieved, 1, false], [time, data.error, 2, false]];
    }
    return [[data.reference_angle_deg, data.reference_torque_Nm, 1, true], [data.achieved_angle_deg, data.achieved_torque_Nm, 1, false]];
  }

  function tracesOf(data, controller, second) {
    const colour = cases.colours[controller], name = label("controller", controller);
    return curvesOf(data).map(([x, y, row, reference], k) => ({
      x, y, type: "scatter", mode: "lines", xaxis: row === 1 ? "x" : "x2", yaxis: row === 1 ? "y" : "y2",
      name: reference ? `reference of ${name}` : name,
      legendgroup: `${name}${reference}`,
      showlegend: row === 1 && (k === 0 || !data.ratio_dB),
      line: reference
        ? { color: second ? colour : inks.line, width: 1.3, dash: second ? "dot" : "dash" }
        : { color: colour, width: second ? 1.8 : 2.4 },
    }));
  }

  // Two panels, one above the other, over the same x.
  function panels(split, x, y, y2) {
    return {
      xaxis: { ...x, title: {}, anchor: "y", matches: "x2", showticklabels: false },
      xaxis2: { ...x, anchor: "y2" },
      yaxis: { ...y, domain: [split + 0.03, 1], anchor: "x" },
      yaxis2: { ...y2, domain: [0, split - 0.03], anchor: "x2" },
    };
  }

  // Wide enough for the band and every curve.
  function reachOf(half, curves) {
    const reach = 1.06 * Math.max(1.25 * half, ...curves.flat().map(Math.abs));
    return [-reach, reach];
  }

  function spanOf(frequencies) {
    const decades = frequencies.flat().map(Math.log10);
    return [Math.min(...decades) - 0.05, Math.max(...decades) + 0.03];
  }

  function layoutOf(shown) {
    const data = shown[0];
    const base = { template, height: 460, legend: { orientation: "h", x: 0, y: 1.02, yanchor: "bottom" }, margin: { t: 40 } };
    const zero = { zeroline: true, zerolinecolor: inks.muted };
    const band = (half, axis) => ({
      type: "rect", xref: axis === "y" ? "x domain" : "x2 domain", x0: 0, x1: 1, yref: axis, y0: -half, y1: half, fillcolor: inks.band, opacity: 0.7,
      line: { width: 0 }, layer: "below",
    });
    if (data.ratio_dB) {
      return {
        ...base,
        ...panels(
          0.5,
          { type: "log", title: { text: "frequency [Hz]" }, tickvals: [0.2, 0.5, 1, 2, 3, 4, 5, 7, 10, 15, 20, 30], range: spanOf(shown.map((one) => one.frequency_Hz)) },
          { title: { text: "magnitude error [dB]" }, range: reachOf(cases.jnd.dB, shown.map((one) => one.ratio_dB)), ...zero },
          { title: { text: "phase error [deg]" }, range: reachOf(cases.jnd.deg, shown.map((one) => one.ratio_deg)), ...zero },
        ),
        shapes: [band(cases.jnd.dB, "y"), band(cases.jnd.deg, "y2")],
      };
    }
    if (data.time_s) {
      const tracked = data.unit === "deg" ? "pinion angle" : "torsion-bar torque";
      return {
        ...base,
        ...panels(0.37, { title: { text: "time [s]" } }, { title: { text: `${tracked} [${data.unit}]` }, ...zero }, { title: { text: `error [${data.unit}]` }, ...zero }),
      };
    }
    return { ...base, xaxis: { title: { text: "pinion angle [deg]" }, ...zero }, yaxis: { title: { text: "torsion-bar torque [N m]" }, ...zero } };
  }

  function kindOf(data) {
    if (data.ratio_dB) return "Achieved over reference; grey: one JND.";
    if (!data.time_s) return "Last cycle; dashed: the reference in the same run.";
    const span_ms = (2e3 * (data.time_s[1] - data.time_s[0])) / Math.max(data.achieved.length - 1, 1);
    return `Dashed: the reference in the same run. Least and greatest value of every ${span_ms.toFixed(0)} ms, so that no peak is lost.`;
  }

  function draw(index, other) {
    const shown = [index, ...(other === null ? [] : [[other, ...index.slice(1)]])];
    const found = shown.map((at) => [at[0], find(at)]);
    const drawn = found.filter(([, one]) => one && one.plot);
    const missing = found.filter(([, one]) => one && !one.plot).map(([k]) => label("controller", k));
    const nobody = { template, height: 460, xaxis: { visible: false }, yaxis: { visible: false }, annotations: [{ text: "nothing to draw", showarrow: false }] };
    const traces = drawn.flatMap(([k, one], n) => tracesOf(one.plot, k, n > 0));
    Plotly.react(plot, traces, drawn.length ? layoutOf(drawn.map(([, one]) => one.plot)) : nobody, config);
    const who = found.map(([k]) => label("controller", k)).join(" and ");
    caption.replaceChildren(element("b", `${who}: ${place(index)}.`), drawn.length ? ` First draw. ${kindOf(drawn[0][1].plot)}` : "",
      missing.length ? ` Not drawn, because the first draw has no plot (unstable, or too little coherence): ${missing.join(", ")}.` : "");
    fillTable(index, found);
  }

  const number = (value) => (value === null ? "–" : String(value).replace("-", "−"));
  const cell = (draw, k) => {
    if (!draw.values) return k ? "" : `unstable after ${number(draw.stopped_s)} s`;
    const value = draw.values[k];
    return Array.isArray(value) ? `${number(value[0])} (${number(value[1])})` : number(value);
  };

  function fillTable(index, found) {
    const metrics = cases.metrics[cases.choices.manoeuvre[index[3]]];
    const known = found.filter(([, one]) => one);
    const names = document.createElement("tr"), draws = document.createElement("tr");
    names.append(element("th", ""), ...known.map(([k, one]) => element("th", label("controller", k), { colspan: one.draws.length, scope: "colgroup" })));
    draws.append(element("th", "metric", { scope: "col" }), ...known.flatMap(([, one]) => one.draws.map((_, k) => element("th", `draw ${k + 1}`, { class: "number", scope: "col" }))));
    const head = document.createElement("thead"), body = document.createElement("tbody");
    head.append(names, draws);
    metrics.forEach((metric, k) => {
      const row = document.createElement("tr"), title = element("th", `${metric.name} [${metric.unit}]`, { scope: "row" });
      title.append(element("small", metric.meaning));
      row.append(title, ...known.flatMap(([, one]) => one.draws.map((draw) => element("td", cell(draw, k), { class: "number" }))));
      body.append(row);
    });
    table.replaceChildren(head, body);
  }

  function update() {
    const index = chosen();
    draw(index, form.elements.other.value === "" ? null : Number(form.elements.other.value));
  }

  function choose(index) {
    cases.fields.forEach((field, k) => { form.elements[field].value = index[k]; });
  }

  function fillWorst() {
    fill(form.elements.worst, [["", "choose …"], ...worstOf(Number(form.elements.controller.value))]);
  }

  for (const field of cases.fields) fill(form.elements[field], cases.choices[field].map((_, k) => [k, label(field, k)]));
  fill(form.elements.other, [["", "nobody"], ...cases.choices.controller.map((_, k) => [k, label("controller", k)])]);
  if (cases.choices.controller.length > 1) form.elements.other.value = 1;
  choose(cases.first.split("."));
  form.addEventListener("submit", (event) => event.preventDefault());
  form.addEventListener("change", (event) => {
    if (event.target.name === "worst" && event.target.value) choose(event.target.value.split("."));
    if (event.target.name === "controller") fillWorst();
    if (event.target.name !== "worst") form.elements.worst.value = "";
    update();
  });
  fillWorst();
  update();
})();
