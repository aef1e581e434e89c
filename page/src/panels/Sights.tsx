// What robots reach and cameras see, and where things usually are, in the scene from above. The server works it out;
// here it is drawn.
import { decides, lit, poses, report, request, thing } from "../state";
import type { CameraFrame, Hand, Pose, Ring, Spec, UsualPlace } from "../types";
import { at, EDGES } from "../scene/top2d";

/** A ring of an arm in its own frame, or the sector between two bearings. */
function path({ nearest, farthest, bearing }: Ring): string {
  const [from, to] = bearing ?? [-Math.PI, Math.PI];
  const middle = (from + to) / 2;
  const arc = (r: number, a: number, b: number) => [a, (a + b) / 2, b].map((angle, k) => `${k ? `A${r} ${r} 0 0 ${b > a ? 1 : 0} ` : ""}${r * Math.cos(angle)} ${r * Math.sin(angle)}`);
  const halves = (r: number, a: number, b: number) => [...arc(r, a, middle), ...arc(r, middle, b).slice(1)].join("");
  return `M${halves(farthest, from, to)}${bearing ? "L" : "ZM"}${halves(nearest, to, from)}Z`;
}

export function Rings({ now, line }: { now: Spec; line: number }) {
  return <>{now.objects.map(({ name, ring }, k) => ring && poses.value[k] ? <path key={name} class="ring" d={path(ring)} transform={at(poses.value[k])} stroke-width={line} stroke-dasharray={`${6 * line} ${4 * line}`} /> : null)}</>;
}

/** The part of the table that a camera pictures, and the camera, as it looks. */
export function Frames({ now, line, side }: { now: Spec; line: number; side: number }) {
  const size = 0.022 * side;
  return (
    <>
      {now.cameras.map(({ name, corners, eye, outside }: CameraFrame) => (
        <g key={name} class="camera" stroke-width={1.4 * line}>
          {corners.length ? <polygon class="camera-frame" points={corners.map((one) => one.join(",")).join(" ")} /> : null}
          <g transform={at(eye)} class={outside ? "eye outside" : "eye"}>
            <path d={`M0 0L${1.6 * size} ${0.9 * size}V${-0.9 * size}Z`} />
            <circle r={0.45 * size} />
          </g>
        </g>
      ))}
    </>
  );
}

/** The name of a camera beside its eye: x, y, text. */
export function cameraNames(now: Spec, side: number): [number, number, string][] {
  return now.cameras.map(({ name, eye: [x, y, theta] }) => [x + 0.062 * side * Math.cos(theta), y + 0.062 * side * Math.sin(theta), name]);
}

/** Open hands over what formulas want them to grasp; that of the object that decides phi, or is pointed at, stands out. */
export function Hands({ now, line }: { now: Spec; line: number }) {
  const ghost = ({ thing: k, boxes }: Hand, place: number) => {
    const pose: Pose | undefined = poses.value[k], { name } = now.objects[k];
    const decided = decides.value?.text.includes(`handRoom(${name},`);
    return pose ? (
      <g key={place} class={`hand${decided || lit.value === name || thing.value === name ? " near" : ""}`} transform={at(pose)} stroke-width={line}>
        {boxes.map((one, part) => <polygon key={part} class={part < 2 ? "finger" : "palm"} points={one.map((point) => point.join(",")).join(" ")} stroke-dasharray={part < 2 ? undefined : `${3 * line} ${2 * line}`} />)}
      </g>
    ) : null;
  };
  return <>{(report.value?.hands ?? []).map(ghost)}</>;
}

const FEW = 6; // usual places up to which all are shown, not only that of the object that is chosen or pointed at

/** Where things usually are. One that is kept in place has no prior. */
export function UsualPlaces({ now, line, side }: { now: Spec; line: number; side: number }) {
  const all = (report.value?.usual ?? []).map((one) => ({ ...one, things: one.things.filter((k) => !(now.objects[k].name in request.value.fix)) })).filter(({ things }) => things.length);
  const meant = ({ things }: UsualPlace) => things.find((k) => [thing.value, lit.value].includes(now.objects[k].name));
  const dark = (share: number) => 0.05 + 0.16 * share;
  return (
    <>
      {all.filter((one) => all.length <= FEW || meant(one) !== undefined).map((one) => {
        const { things, within: [x0, y0, x1, y1], discs, areas, dots } = one;
        const id = `usual-${things[0]}`, ink = EDGES[(meant(one) ?? things[0]) % EDGES.length];
        return (
          <g key={id} class={`usual${meant(one) === undefined ? "" : " near"}`} fill={ink} stroke={ink} stroke-width={(meant(one) === undefined ? 0.5 : 1.2) * line} data-things={things.map((k) => now.objects[k].name).join(" ")}>
            <clipPath id={id}><rect x={x0} y={y0} width={x1 - x0} height={y1 - y0} /></clipPath>
            <g clip-path={`url(#${id})`}>
              {discs.map(({ middle: [x, y], inner, outer, share }) => [outer, inner].map((r) => <circle key={r} cx={x} cy={y} r={r} fill-opacity={dark(share)} />))}
              {areas.map(({ corners, share }, k) => <polygon key={k} points={corners.map((point) => point.join(",")).join(" ")} fill-opacity={dark(share)} />)}
            </g>
            {dots.map(([x, y], k) => <circle key={k} class="dot" cx={x} cy={y} r={0.004 * side} />)}
          </g>
        );
      })}
    </>
  );
}

/** How much of an object each camera sees, in words; "" where nothing says that. */
export function share(now: Spec, index: number): string {
  const found = (report.value?.seen ?? []).filter((one) => one.thing === index);
  return found.map(({ camera, words }) => `${now.cameras.length > 1 ? `${camera} ` : ""}${words}`).join("; ");
}
