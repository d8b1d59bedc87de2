"use strict";
// Draws the panels of the page from the data that stands in it. Texts of the recording reach Plotly escaped: it takes
// some markup in its texts.
(() => {
  const INK = "#1d2a35", QUIET = "#5d6b78", GRID = "#e9edf1", BLUE = "#2f6690", PALE = "#f0b366", RED = "#a5281f";
  const LABELS = {
    IDLE: "#dfe3e7", MONITORING_WAIT: "#e8b7a4", MONITORING_READY: "#ecd48a", COMMANDING_WAIT: "#9cc3e0",
    COMMANDING_ACTIVE: "#7dbb8a", POOR: "#d98c80", FAIR: "#ecc27a", GOOD: "#b9d7a8", EXCELLENT: "#7dbb8a",
    T1: "#c9b8dd", T2: "#a9c4dd", AUT: "#cfd8de", RUNNING: "#b9d7a8", PAUSED: "#ecd48a", STOPPED: "#d98c80",
    EMERGENCY_STOP: "#b5473b", OFF: "#d98c80", TRANSITIONING: "#ecd48a", ACTIVE: "#b9d7a8", holding: "#dfe3e7",
    overlay: "#7dbb8a", "application motion": "#8fb5d6", braking: "#d98c80", NORMAL_OPERATION: "#cfd8de",
  };
  const PAPER = 640; // Pixels that fit between the margins of an A4 sheet.
  const OTHERS = ["#a9c4dd", "#c9b8dd", "#b9d7a8", "#e3cfa4", "#9fcfc9"];
  const MARKS = {
    stop: { name: "stops", colour: RED, symbol: "x" },
    warning: { name: "warnings", colour: "#b36b00", symbol: "triangle-up" },
    finding: { name: "findings", colour: "#b36b00", symbol: "diamond" },
    operator: { name: "operator", colour: BLUE, symbol: "circle" },
  };
  const MARGIN = { l: 78, r: 14, t: 28, b: 34 };
  const CONFIG = {
    displaylogo: false, responsive: true, doubleClick: "reset",
    modeBarButtons: [["toImage", "zoom2d", "pan2d", "resetScale2d"]],
  };
  const safe = (text) => String(text).replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");

  function folded(text, width) {
    const lines = [""];
    for (const word of String(text).split(" ")) {
      if ((lines.at(-1) + word).length > width) lines.push("");
      lines[lines.length - 1] += (lines.at(-1) ? " " : "") + word;
    }
    return lines.map(safe).join("<br>");
  }

  function layout(height, more) {
    return {
      height, margin: MARGIN, paper_bgcolor: "#fff", plot_bgcolor: "#fff", hovermode: "x", showlegend: false,
      font: { family: getComputedStyle(document.body).fontFamily, size: 12.5, color: INK },
      hoverlabel: { bgcolor: "#fff", bordercolor: "#b9c3cc", font: { color: INK, size: 12.5 }, align: "left" },
      ...more,
      xaxis: { ticksuffix: " s", gridcolor: GRID, zeroline: false, linecolor: "#c5cdd4", ...(more.xaxis || {}) },
      yaxis: { gridcolor: GRID, zerolinecolor: GRID, linecolor: "#c5cdd4", automargin: false, ...(more.yaxis || {}) },
    };
  }

  const limit = (value, text) => [
    { type: "line", xref: "paper", x0: 0, x1: 1, y0: value, y1: value, line: { color: RED, width: 1.3, dash: "dash" } },
    {
      xref: "paper", x: 0, y: value, text, showarrow: false, xanchor: "left", yanchor: "bottom",
      font: { color: RED, size: 11.5 },
    },
  ];

  function bytes(text) {
    const packed = atob(text), found = new Uint8Array(packed.length);
    for (let at = 0; at < packed.length; at++) found[at] = packed.charCodeAt(at);
    return found.buffer;
  }

  const unpacked = (series) => ({
    x: Float64Array.from(new Uint32Array(bytes(series.x)), (steps) => steps * series.step),
    y: new Float32Array(bytes(series.y)),
  });

  function stops(robot) {
    return robot.marks.filter((mark) => mark[1] === "stop").slice(0, 100).map((mark) => ({
      type: "line", yref: "paper", x0: mark[0], x1: mark[0], y0: 0, y1: 1, layer: "below",
      line: { color: "#a5281f88", width: 1, dash: "dot" },
    }));
  }

  function timeline(robot) {
    const traces = [], rows = [];
    for (const lane of robot.lanes) {
      const name = safe(lane.name);
      rows.push(name);
      const labels = [...new Set(lane.spans.map((span) => span[2]))];
      const colour = (label) => LABELS[label] || OTHERS[labels.indexOf(label) % OTHERS.length];
      traces.push({
        type: "bar", orientation: "h", y: lane.spans.map(() => name), base: lane.spans.map((span) => span[0]),
        x: lane.spans.map((span) => span[1] - span[0]), width: 0.74, offset: -0.37,
        marker: { color: lane.spans.map((span) => colour(span[2])), line: { width: 0.6, color: lane.spans.map((span) => colour(span[2])) } },
        text: lane.spans.map((span) => safe(span[2])), textposition: "inside", insidetextanchor: "start", textangle: 0,
        insidetextfont: { color: INK, size: 11.5 }, hoverinfo: "text",
        hovertext: lane.spans.map((span) => `<b>${safe(lane.name)}: ${safe(span[2])}</b><br>${span[0].toFixed(3)} to ` +
          `${span[1].toFixed(3)} s${span[3] ? "<br>" + folded(span[3], 70) : ""}`),
      });
    }
    for (const [kind, look] of Object.entries(MARKS)) {
      const marks = robot.marks.filter((mark) => mark[1] === kind);
      if (!marks.length) continue;
      rows.push(look.name);
      traces.push({
        type: "scatter", mode: "markers", x: marks.map((mark) => mark[0]), y: marks.map(() => look.name),
        marker: { color: look.colour, symbol: look.symbol, size: 9 }, hoverinfo: "text",
        hovertext: marks.map((mark) => `<b>${mark[0].toFixed(3)} s</b><br>${folded(mark[2], 70)}`),
      });
    }
    return [traces, layout(46 + 27 * rows.length, {
      hovermode: "closest", margin: { ...MARGIN, t: 6 }, barmode: "overlay", uniformtext: { mode: "hide", minsize: 9 }, shapes: stops(robot),
      yaxis: { categoryorder: "array", categoryarray: rows.reverse(), fixedrange: true, range: [-0.6, rows.length - 0.4] },
    })];
  }

  function latency(robot) {
    const log = robot.budget && robot.largest > 8 * robot.budget;
    const high = Math.max(robot.largest * 1.05, (robot.budget || 0) * 1.15);
    const series = unpacked(robot.latency);
    const [line, words] = limit(robot.budget, `budget ${robot.budget} ms`);
    if (log) words.y = Math.log10(robot.budget);
    return [[{
      type: "scatter", mode: "markers", ...series, marker: { size: 2.6, color: BLUE }, name: "answer",
      hovertemplate: "%{y:.3f} ms<extra></extra>",
    }], layout(230, {
      shapes: [line, ...stops(robot)], annotations: [words], hovermode: "closest",
      yaxis: log ? { type: "log", ticksuffix: " ms", exponentformat: "none" } : { range: [0, high], ticksuffix: " ms" },
    })];
  }

  function histogram(robot) {
    const place = (bar) => (Math.log10(Math.max(bar[0], bar[1] / 1.122)) + Math.log10(bar[1])) / 2;
    const places = robot.bars.map(place), budget = Math.log10(robot.budget);
    const low = Math.min(...places, budget) - 0.08, high = Math.max(...places, budget) + 0.08;
    const most = Math.max(...robot.bars.map((bar) => bar[2])), digits = high - low < 1.7 ? [1, 2, 5] : [1], ticks = [];
    for (let decade = Math.floor(low); decade <= Math.ceil(high); decade++) {
      for (const digit of digits) ticks.push(digit * 10 ** decade);
    }
    return [[{
      type: "bar", x: places, y: robot.bars.map((bar) => bar[2]), width: 0.046, marker: { color: "#5b8db3" },
      hoverinfo: "text",
      hovertext: robot.bars.map((bar) => `${bar[2]} answers<br>${bar[0].toPrecision(3)} to ${bar[1].toPrecision(3)} ms`),
    }], layout(230, {
      hovermode: "closest", margin: { ...MARGIN, l: 54 },
      shapes: [{ type: "line", yref: "paper", x0: budget, x1: budget, y0: 0, y1: 1, line: { color: RED, width: 1.3, dash: "dash" } }],
      annotations: [{
        x: budget, yref: "paper", y: 1, text: `budget ${robot.budget} ms `, showarrow: false, xanchor: "right",
        yanchor: "top", font: { color: RED, size: 11.5 }, bgcolor: "#ffffffcc",
      }],
      xaxis: {
        tickvals: ticks.map(Math.log10), ticktext: ticks.map((tick) => String(+tick.toPrecision(1))), ticksuffix: "",
        range: [low, high], title: { text: "ms", standoff: 2, font: { size: 12 } },
      },
      yaxis: {
        type: "log", tickvals: Array.from({ length: 12 }, (_, decade) => 10 ** decade), exponentformat: "none",
        range: [Math.log10(0.7), Math.log10(most * 1.6)],
      },
    })];
  }

  function positions(robot, axis) {
    const one = robot.axes[axis], name = safe(one.name);
    return [[
      {
        type: "scatter", mode: "lines", ...unpacked(one.commanded), name: "commanded", line: { color: PALE, width: 4 },
        hovertemplate: "commanded %{y:.5f} rad<extra></extra>",
      },
      {
        type: "scatter", mode: "lines", ...unpacked(one.measured), name: "measured", line: { color: "#173a57", width: 1.1 },
        hovertemplate: "measured %{y:.5f} rad<extra></extra>",
      },
    ], layout(270, {
      showlegend: true, legend: { orientation: "h", x: 0, y: 1.0, yanchor: "bottom", bgcolor: "#ffffffcc" }, margin: { ...MARGIN, b: 26 },
      shapes: stops(robot), yaxis: { title: { text: `${name}, rad`, standoff: 6 } },
    })];
  }

  const difference = (robot, axis) => [[{
    type: "scatter", mode: "lines", ...unpacked(robot.axes[axis].difference), line: { color: "#8a5a2b", width: 1 },
    hovertemplate: "%{y:.4f} mrad<extra></extra>", name: "difference",
  }], layout(150, {
    shapes: stops(robot), yaxis: { title: { text: "measured -<br>commanded, mrad", standoff: 6, font: { size: 11.5 } } },
  })];

  function speed(robot) {
    const series = unpacked(robot.speed);
    const high = 1.1 * Math.max(robot.t1, series.y.reduce((most, one) => Math.max(most, one), 0));
    const [line, words] = limit(robot.t1, `T1: ${robot.t1} mm/s`);
    return [[{
      type: "scatter", mode: "lines", ...series, line: { color: "#2c7a4b", width: 1.2 }, name: "flange",
      hovertemplate: "%{y:.2f} mm/s<extra></extra>",
    }], layout(220, { shapes: [line, ...stops(robot)], annotations: [words], yaxis: { range: [0, high], title: { text: "mm/s", standoff: 6 } } })];
  }

  const PANELS = { timeline, latency, histogram, positions, difference, speed };

  // All panels of a robot show the same stretch of time, and a line where the pointer is.
  function together(section, robot, plots) {
    const cursor = section.querySelector(".cursor"), area = section.querySelector(".plots");
    let busy = false;
    const inTime = plots.filter((plot) => plot.dataset.panel !== "histogram");
    for (const plot of inTime) {
      plot.on("plotly_relayout", async (change) => {
        const asked = "xaxis.range[0]" in change || "xaxis.range" in change || "xaxis.autorange" in change;
        if (busy || !asked) return;
        busy = true;
        const range = plot.layout.xaxis.range.slice();
        await Promise.all(inTime.map((other) => Plotly.relayout(other, { "xaxis.range": range.slice(), ...fitted(other, range) })));
        busy = false;
      });
      plot.on("plotly_hover", (event) => {
        const at = event.event;
        if (!at) return;
        const frame = area.getBoundingClientRect();
        cursor.style.display = "block";
        cursor.style.height = `${frame.height}px`;
        cursor.style.left = `${at.clientX - frame.left}px`;
      });
      plot.on("plotly_unhover", () => { cursor.style.display = "none"; });
    }
  }

  // The values that are in sight fill the height, where no limit is to be seen beside them.
  function fitted(plot, range) {
    if (!["positions", "difference"].includes(plot.dataset.panel)) return {};
    let low = Infinity, high = -Infinity;
    for (const { x, y } of plot.sources) {
      for (let at = 0; at < x.length; at++) {
        if (x[at] < range[0] || x[at] > range[1]) continue;
        low = Math.min(low, y[at]);
        high = Math.max(high, y[at]);
      }
    }
    if (low > high) return {};
    const room = Math.max(0.06 * (high - low), 1e-6);
    return { "yaxis.range": [low - room, high + room] };
  }

  async function drawRobot(section, robot) {
    const plots = [...section.querySelectorAll(".plot")];
    const whole = [0, Math.max(robot.end, 1e-3)];
    let axis = robot.moved;
    const draw = (plot, range) => {
      const [traces, shape] = PANELS[plot.dataset.panel](robot, axis);
      plot.sources = traces;
      if (plot.dataset.panel !== "histogram") shape.xaxis = { ...shape.xaxis, range: range.slice() };
      if (["positions", "difference"].includes(plot.dataset.panel)) {
        const fit = fitted(plot, range)["yaxis.range"];
        if (fit) shape.yaxis = { ...shape.yaxis, range: fit };
      }
      return Plotly.react(plot, traces, shape, { ...CONFIG, displayModeBar: plot.dataset.panel === "timeline" ? false : "hover" });
    };
    for (const plot of plots) await draw(plot, whole);
    together(section, robot, plots);
    const buttons = [...section.querySelectorAll(".axes button")];
    const press = () => buttons.forEach((button, at) => button.setAttribute("aria-pressed", String(at === axis)));
    buttons.forEach((button, at) => button.addEventListener("click", () => {
      axis = at;
      press();
      for (const plot of plots) {
        if (["positions", "difference"].includes(plot.dataset.panel)) draw(plot, plot.layout.xaxis.range);
      }
    }));
    press();
  }

  async function library() {
    const packed = document.getElementById("library").textContent.trim();
    const stream = new Blob([bytes(packed)]).stream().pipeThrough(new DecompressionStream("gzip"));
    const script = document.createElement("script");
    script.textContent = await new Response(stream).text();
    document.head.append(script);
  }

  function fitPaper() {
    for (const more of document.querySelectorAll("details.more")) more.open = true;
    for (const plot of document.querySelectorAll(".plot")) if (plot.layout) Plotly.relayout(plot, { width: PAPER });
  }

  async function start() {
    try {
      await library();
      const data = JSON.parse(document.getElementById("data").textContent);
      const sections = [...document.querySelectorAll("section.robot")];
      for (let at = 0; at < sections.length; at++) await drawRobot(sections[at], data.robots[at]);
      document.documentElement.dataset.drawn = "yes";
      addEventListener("beforeprint", fitPaper);
      addEventListener("afterprint", () => {
        for (const plot of document.querySelectorAll(".plot")) if (plot.layout) Plotly.relayout(plot, { width: null, autosize: true });
      });
    } catch (error) {
      document.getElementById("undrawn").hidden = false;
      console.error(error);
    }
  }
  start();
})();
