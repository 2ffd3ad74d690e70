/**
 * Worker of the page: searches and best equal gaps, so that nothing stalls.
 *
 * The first message is {type: "load", bytes}, with the bytes of chain.wasm. Then, each with an id that
 * its answers have too: {type: "search", document, start, seconds, seed, baseline} (baseline: layout and
 * score of the best equal gaps, if they are known), answered by {type: "better", layout, score, seconds}
 * and {type: "done", layout, score, seconds, reason}; {type: "uniform", document}, by {type: "uniform",
 * point, layout, score}; {type: "score", document, layout} (of free-standing dominoes, say), by {type:
 * "score", score, text}; {type: "check", document, layout}, by {type: "check", text}; {type: "measure",
 * document, layout, samples, rate}, by {type: "measure", …} with the values of `measure.js`; each of them
 * by {type: "error", message} if something is wrong. {type: "stop"} ends a search, which still answers
 * "done"; so does another search.
 */

import { loadKernels } from "./kernels.js";
import { Scene } from "./scene.js";
import { search } from "./search.js";
import { check } from "./check.js";
import { measure } from "./measure.js";

/** Answer the messages of a page at the other end of a port. */
export function serve(port) {
  let loading, searches = 0;
  const answers = {
    search(kernels, { id, document, baseline, ...options }) {
      const number = ++searches, shouldStop = () => number !== searches;
      const onBetter = (better) => port.postMessage({ id, type: "better", ...better });
      return search(Object.assign(new Scene(kernels, document), { baseline }), { ...options, onBetter, shouldStop });
    },
    uniform(kernels, { document }) {
      const { point, layout, score } = new Scene(kernels, document).uniform();
      return { point, layout, score };
    },
    score(kernels, { document, layout }) {
      const { score, text } = new Scene(kernels, document).score(layout);
      return { score, text };
    },
    check(kernels, { document, layout }) {
      return { text: check(kernels, new Scene(kernels, document), layout) };
    },
    measure(kernels, { document, layout, samples, rate }) {
      const scene = new Scene(kernels, document);
      return measure(kernels, samples, rate, scene.row(layout), scene.physics);
    },
  };
  port.onmessage = async ({ data }) => {
    const { id, type } = data;
    if (type === "load") loading = loadKernels(data.bytes);
    else if (type === "stop") searches += 1;
    else {
      try {
        const answer = await answers[type](await loading, data);
        port.postMessage({ id, type: type === "search" ? "done" : type, ...answer });
      } catch (error) {
        port.postMessage({ id, type: "error", message: error.message });
      }
    }
  };
}

if (globalThis.WorkerGlobalScope) serve(globalThis);
