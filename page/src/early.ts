// The first look: a few scenes in the wanted ranges, until the wanted scenes are there. For a new text it is asked for
// together with what the text means, before that is known.
import { askOne, stop } from "./server";
import { about, boot, request, spec, text } from "./state";
import type { Ends, Result } from "./types";

export interface Look {
  held: string;
  found: Promise<Result | null>; // null where nothing is found soon
}

let under: Look | null = null;

const held = () => JSON.stringify(request.value.fix);

/** The range of labels that nobody has asked for yet. A file of scenes says what was wanted. */
export function others(): Ends {
  return boot.scenes && text.value === boot.text ? [null, null] : [0, null];
}

function ask(more: { others?: Ends }): Look {
  leaveLook();
  const found = askOne<Result | null>("first", { ...about(), request: { ...request.value, ...more } }).catch(() => null);
  const mine: Look = { held: held(), found };
  under = mine;
  void found.then(() => under === mine && (under = null));
  return mine;
}

/** Ask for a first look at a text that the server has not read yet. */
export function foresee(): Look {
  return ask({ others: others() });
}

/** The first look at the spec as it stands: the one that was asked for early, if that still fits. */
export function look(early: Look | null): Look | null {
  if (spec.value!.time) return null;
  return early?.held === held() ? early : ask({});
}

/** Nobody waits for a first look any more. */
export function leaveLook(): void {
  if (under) void stop("first");
  under = null;
}
