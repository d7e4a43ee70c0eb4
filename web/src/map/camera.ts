/// Where the picture looks: ENU metres to pixels.
import type { Vec3 } from '../live/messages';

export interface Camera {
  readonly e: number;
  readonly n: number;
  readonly px_per_m: number;
  readonly w: number;
  readonly h: number;
}
export const to_px = (cam: Camera, m: Vec3 | readonly [number, number]): [number, number] => [
  cam.w / 2 + (m[0] - cam.e) * cam.px_per_m,
  cam.h / 2 - (m[1] - cam.n) * cam.px_per_m,
];
