/// The map: OpenLayers carries view, gestures and the slow picture; one canvas above it is drawn in requestAnimationFrame. Loaded as a chunk of its own.
import { defaults as default_interactions } from 'ol/interaction/defaults.js';
import Layer from 'ol/layer/Layer.js';
import OlMap from 'ol/Map.js';
import Projection from 'ol/proj/Projection.js';
import View from 'ol/View.js';
import { to_px, type Camera } from './camera';
import { magnification } from './enu';
import { ms_a_pixel } from './motion';
import { read_palette, type Palette } from './palette';
import { next_picture } from '../state/pace';
import { interpolated } from '../state/scene';
import type { Box } from './symbols';
import { draw_fast, draw_slow, draw_top, mark_trail, trail_stands, type Content, type TrailMark } from './picture';

export type Mode = 'fit' | 'follow' | 'free';
export interface MapView {
  changed(): void; ///< slow content is new
  theme_changed(): void;
  mode(mode: Mode): void;
  zoom(steps: number): void;
  close(): void;
}
export interface MapHooks {
  content(): Content;
  selected(anchor: string): void;
  mode_changed(mode: Mode): void;
  camera_changed(px_per_m: number, magnified: number): void;
}

// Metres of a site: no projection on the globe, so ellipses are ellipses and doubles go all the way.
const ENU = new Projection({ code: 'anchord:enu', units: 'm', extent: [-2e5, -2e5, 2e5, 2e5] });
const PLAN_NEAR_M = 300;
// Between two pictures while the drone moves by less than a pixel, and while nothing comes of it or less motion is asked for: the battery is an
// operator's too.
const PICTURE_MS = 1000 / 60,
  STANDS_MS = 50,
  QUIET_MS = 95;
const screen_ratio = (): number => Math.min(2, devicePixelRatio || 1);
const reduced = matchMedia('(prefers-reduced-motion: reduce)');

/// Where buttons and scales lie over the map: no name is written under them.
function covered(target: HTMLElement): Box[] {
  const at = target.getBoundingClientRect(),
    over = target.parentElement?.querySelectorAll(':scope > :is(.mapui, .scalebar, .levelchoice)') ?? [];
  return [...over].map((e) => {
    const r = e.getBoundingClientRect();
    return { x: r.x - at.x, y: r.y - at.y, w: r.width, h: r.height };
  });
}

export function open_map(
  target: HTMLElement,
  overlay: HTMLCanvasElement,
  top: HTMLCanvasElement,
  hooks: MapHooks,
): MapView {
  let palette: Palette = read_palette();
  let mode: Mode = 'fit';
  let magnified = 1;
  let closed = false;
  let trail_mark: TrailMark | null = null;
  const slow = document.createElement('canvas');
  slow.style.position = 'absolute';
  const view = new View({
    projection: ENU,
    center: [0, 0],
    resolution: 0.06,
    minResolution: 0.001,
    maxResolution: 60,
    constrainResolution: false,
    smoothResolutionConstraint: false,
    enableRotation: false,
  });
  const camera = (): Camera => {
    const [w, h] = map.getSize() ?? [1, 1];
    const [e, n] = view.getCenter() ?? [0, 0];
    return { e: e!, n: n!, px_per_m: 1 / (view.getResolution() ?? 1), w: w!, h: h! };
  };
  const sized = (canvas: HTMLCanvasElement, cam: Camera): CanvasRenderingContext2D | null => {
    const ratio = screen_ratio(),
      [w, h] = [Math.round(cam.w * ratio), Math.round(cam.h * ratio)];
    if (canvas.width !== w || canvas.height !== h) {
      canvas.width = w;
      canvas.height = h;
      canvas.style.width = `${cam.w}px`;
      canvas.style.height = `${cam.h}px`;
    }
    const c = canvas.getContext('2d');
    c?.setTransform(ratio, 0, 0, ratio, 0, 0);
    return c;
  };
  const layer = new Layer({
    render: () => {
      const cam = camera(),
        c = sized(slow, cam),
        content = hooks.content();
      magnified = magnification(
        content.anchors.flatMap((a) => (a.ellipse95 && a.status !== 'ambiguous' ? [a.ellipse95.major_m] : [])),
        cam.px_per_m,
      );
      if (c) draw_slow(c, palette, cam, content, magnified);
      trail_mark = mark_trail(content);
      const t = sized(top, cam);
      if (t) draw_top(t, palette, cam, content, covered(target));
      hooks.camera_changed(cam.px_per_m, magnified);
      dirty = true;
      at_once();
      return slow;
    },
  });
  const map = new OlMap({
    target,
    view,
    layers: [layer],
    controls: [],
    maxTilesLoading: 1,
    interactions: default_interactions({
      altShiftDragRotate: false,
      pinchRotate: false,
      zoomDuration: reduced.matches ? 0 : 200,
    }),
  });

  const set_mode = (next: Mode): void => {
    if (mode === next) return;
    mode = next;
    hooks.mode_changed(mode);
  };
  map.on('pointerdrag', () => set_mode('free'));
  target.addEventListener('wheel', () => set_mode('free'), { passive: true });
  target.addEventListener('keydown', (e) => {
    if (e.key.startsWith('Arrow')) set_mode('free');
  });
  map.on('click', (e) => {
    const [x, y] = e.pixel as [number, number],
      cam = camera();
    let best: { id: string; d: number } | null = null;
    for (const a of hooks.content().anchors) {
      if (!a.enu_m) continue;
      const [ax, ay] = to_px(cam, a.enu_m),
        d = Math.hypot(ax - x, ay - y);
      if (d < 28 && (!best || d < best.d)) best = { id: a.anchor, d };
    }
    if (best) hooks.selected(best.id);
  });

  /// Everything known, in metres; null while nothing is.
  const extent = (): [number, number, number, number] | null => {
    const { anchors, scene, flight, reach_m = [] } = hooks.content();
    const box: [number, number, number, number] = [Infinity, Infinity, -Infinity, -Infinity];
    const add = (e: number, n: number): void => {
      box[0] = Math.min(box[0], e);
      box[1] = Math.min(box[1], n);
      box[2] = Math.max(box[2], e);
      box[3] = Math.max(box[3], n);
    };
    const trail = scene?.trail ?? [];
    for (const q of trail) add(q.e, q.n);
    for (const q of reach_m) add(q[0], q[1]);
    const d = scene?.pose?.value.enu_m;
    if (d) add(d[0], d[1]);
    // An estimate that is still far off (hundreds of metres at first) must not shrink the flight to a dot.
    const span = Math.max(60, 2 * Math.hypot(box[2] - box[0], box[3] - box[1]) || 0),
      flown = trail.length + reach_m.length > 0 || !!d;
    // What is to be flown belongs to the picture, unless it is a plan of another place.
    for (const q of flight ? [...flight.outline, ...flight.waypoints] : [])
      if (!flown || Math.hypot(q[0] - (box[0] + box[2]) / 2, q[1] - (box[1] + box[3]) / 2) < span + PLAN_NEAR_M)
        add(q[0], q[1]);
    const [ce, cn] = [(box[0] + box[2]) / 2, (box[1] + box[3]) / 2];
    for (const a of anchors)
      for (const q of [a.enu_m, a.mirror?.enu_m])
        if (q && (!flown || Math.hypot(q[0] - ce, q[1] - cn) < span)) add(q[0], q[1]);
    if (!Number.isFinite(box[0])) return null;
    const grow = Math.max(2.5 - (box[2] - box[0]) / 2, 2.5 - (box[3] - box[1]) / 2, 0);
    return [box[0] - grow, box[1] - grow, box[2] + grow, box[3] + grow];
  };
  let fitted: readonly number[] | null = null;
  const fit = (always: boolean): void => {
    const box = extent(),
      size = map.getSize();
    if (!box || !size || !(size[0]! > 80) || !(size[1]! > 80)) return;
    // Refit only when something left the fitted box or it became much too large: a map that breathes cannot be read.
    const same =
      fitted &&
      box[0] >= fitted[0]! &&
      box[1] >= fitted[1]! &&
      box[2] <= fitted[2]! &&
      box[3] <= fitted[3]! &&
      box[2] - box[0] + (box[3] - box[1]) > 0.45 * (fitted[2]! - fitted[0]! + (fitted[3]! - fitted[1]!));
    if (same && !always) return;
    const m = Math.max(box[2] - box[0], box[3] - box[1]) * (always ? 0 : 0.06);
    fitted = [box[0] - m, box[1] - m, box[2] + m, box[3] + m];
    const [w, h] = size as [number, number];
    view.fit(fitted as number[], {
      padding: [h * 0.06 + 14, w * 0.07 + 48, h * 0.06 + 40, w * 0.07 + 60],
      maxZoom: 40,
      minResolution: 0.008,
    });
  };
  const follow = (): void => {
    const d = hooks.content().scene?.pose?.value.enu_m;
    if (!d) return;
    const cam = camera(),
      [x, y] = to_px(cam, d);
    if (Math.abs(x - cam.w / 2) < cam.w / 4 && Math.abs(y - cam.h / 2) < cam.h / 4) return;
    view.cancelAnimations();
    if (reduced.matches) view.setCenter([d[0], d[1]]);
    else view.animate({ center: [d[0], d[1]], duration: 240 });
  };

  const aim = (): void => {
    if (mode === 'fit') fit(false);
    if (mode === 'follow') follow();
  };

  let dirty = true,
    drawn = -1,
    last_ms = 0,
    aimed_ms = 0,
    place = '',
    resting: ReturnType<typeof setTimeout> | null = null;
  const rest = (ms: number): void => {
    if (ms < 1.5 * PICTURE_MS) next_picture(frame);
    else
      resting = setTimeout(() => {
        resting = null;
        next_picture(frame);
      }, ms - PICTURE_MS);
  };
  const at_once = (): void => {
    if (resting === null) return;
    clearTimeout(resting);
    resting = null;
    next_picture(frame);
  };
  const frame = (t: number): void => {
    if (closed) return;
    const content = hooks.content(),
      scene = content.scene,
      flies = scene?.pose && t - scene.pose.came_ms < 1500 ? scene : null;
    const glides = flies && !reduced.matches;
    rest(glides ? Math.min(STANDS_MS, ms_a_pixel(flies, camera().px_per_m * screen_ratio())) : QUIET_MS);
    if (t - aimed_ms > 300) {
      aimed_ms = t;
      aim();
    }
    const cam = camera(),
      now = performance.now(),
      at = flies && interpolated(flies, now),
      // A pixel of the screen and two degrees: less than that nobody sees.
      here = at
        ? [...to_px(cam, at.body).map((x) => x * screen_ratio()), (at.heading_deg ?? 0) / 2].map(Math.round).join()
        : '';
    // What is new beside it, ten times a second; while nothing comes, four times, for ages and fading.
    const moved = dirty || here !== place,
      news = scene?.version !== drawn && t - last_ms > 95;
    if (!moved && !news && t - last_ms < 250) return;
    if (!trail_stands(trail_mark, content)) layer.changed();
    const c = sized(overlay, cam);
    if (c) draw_fast(c, palette, cam, content, now, trail_mark?.scene === scene ? trail_mark.points : 0);
    dirty = false;
    place = here;
    drawn = scene?.version ?? -1;
    last_ms = t;
  };
  next_picture(frame);
  const resized = new ResizeObserver(() => {
    map.updateSize();
    fitted = null;
    dirty = true;
    at_once();
    if (mode === 'fit') fit(false);
  });
  resized.observe(target);

  return {
    changed: () => {
      aim();
      layer.changed();
    },
    theme_changed: () => {
      palette = read_palette();
      dirty = true;
      layer.changed();
    },
    mode: (next) => {
      set_mode(next);
      if (next === 'fit') {
        fitted = null;
        fit(true);
      }
      if (next === 'follow') {
        const d = hooks.content().scene?.pose?.value.enu_m;
        if (d) view.setCenter([d[0], d[1]]);
      }
    },
    zoom: (steps) => {
      set_mode('free');
      view.animate({ zoom: (view.getZoom() ?? 1) + steps, duration: reduced.matches ? 0 : 160 });
    },
    close: () => {
      closed = true;
      if (resting !== null) clearTimeout(resting);
      resized.disconnect();
      map.setTarget(undefined);
      map.dispose();
    },
  };
}
