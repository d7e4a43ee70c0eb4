/// The guide: what an operator needs from the case to a published calibration. Short, plain, offline. No DOM.
export type Block =
  | { readonly p: string }
  | { readonly h: string }
  | { readonly steps: readonly string[] }
  | { readonly list: readonly string[] }
  | { readonly head: readonly string[]; readonly rows: readonly (readonly string[])[] };
export interface Page {
  readonly id: string;
  readonly title: string;
  readonly group: 'Set up' | 'Fly' | 'Screens' | 'When something is missing';
  readonly blocks: readonly Block[];
}

export const PAGES: readonly Page[] = [
  {
    id: 'mounting',
    title: 'Mount the tag and the receiver',
    group: 'Set up',
    blocks: [
      {
        p:
          'The UWB tag measures distances, the RTK receiver says where it is. Both are fixed to the aircraft so that neither moves ' +
          'against the other.',
      },
      {
        steps: [
          'Fix the GNSS antenna on top, level, with a free view of the sky and its ground plane under it.',
          'Fix the tag below or at a side, antenna upright, at least 10 cm from carbon, batteries and motors: carbon takes 10 dB and more.',
          'Keep the antenna of the tag 20 cm away from the antennas of video and remote control.',
          'Tie the cables so that they do not pull on either antenna.',
          'Balance the aircraft and hover once by hand.',
        ],
      },
      { p: 'After a hard landing, or whenever something was taken off, measure the lever arm again.' },
    ],
  },
  {
    id: 'lever-arm',
    title: 'Measure the lever arm, and check it in flight',
    group: 'Set up',
    blocks: [
      {
        p:
          'The lever arm leads from the point that the track is of (the GNSS antenna) to the antenna of the tag: forward, left, up,' +
          ' in metres. An error of 5 cm moves every anchor by up to 5 cm, whatever else is done.',
      },
      {
        steps: [
          'Put the aircraft level. Forward is where its nose points.',
          "Measure from the middle of the GNSS antenna's phase centre (its label gives the height above the mount) to the middle of the tag's antenna.",
          'Forward and left are positive; below the antenna is negative. Example: 12 cm ahead, 28 cm below is 0.12, 0, −0.28.',
          'Say how well: one sigma of the forward and left part. With a tape measure 0.02 m; by eye 0.05 m; from the drawing of the mount 0.005 m.',
          'Give both with the flight: tags and lever_arm_sigma_m of POST /missions or of flight.json, or the fields of Import. System, Lever arms, shows them.',
        ],
      },
      { h: 'Check' },
      {
        list: [
          'In flight: a 360° turn over one point. With a wrong lever arm the residuals of all anchors swing with the heading.',
          'A flight of one heading shows nothing of a wrong lever arm, and where nobody says how well it was measured its anchors are withheld for that;' +
            ' nor does a track without heading. Let the nose follow the course, or hold a heading a quarter turn away for 20 s.',
          'After the flight: the calibration solves what is left of it and reports it as the antenna offset of the kit. More than 3 cm: measure again.',
        ],
      },
    ],
  },
  {
    id: 'base',
    title: 'Base station and NTRIP',
    group: 'Set up',
    blocks: [
      {
        p: 'Anchors are as right as the base: relative to it within centimetres, on the globe only as well as its own coordinates are known.',
      },
      {
        head: ['Base', 'Absolute accuracy', 'How'],
        rows: [
          [
            'Network (NTRIP)',
            '1 to 3 cm',
            'System, Devices: add an NTRIP source with caster, mount point, name and password',
          ],
          ['Own base on a known point', 'that of the point', 'Type its coordinates into the base, not into this page'],
          [
            'Own base, survey-in',
            '1 to 3 m after minutes',
            'Enough when only distances within the building count; say so in System, Base and datum',
          ],
        ],
      },
      {
        steps: [
          'Choose a base within 20 km; beyond 10 km FIX takes longer.',
          'Wait for FIX with an age of corrections below 2 s for 10 s: the checklist asks for it.',
          'In System, Base and datum, say how the place of the base is known, in which frame and epoch. Without it no absolute accuracy is given.',
        ],
      },
      { p: 'FLOAT is a position without whole cycles: decimetres off. Its ranges are kept and carry little weight.' },
    ],
  },
  {
    id: 'radio',
    title: 'Radio settings',
    group: 'Set up',
    blocks: [
      {
        p:
          'Tag and anchors receive each other only with the same channel, bit rate, pulse repetition frequency and preamble. System' +
          ' compares the tag with every anchor in its reach and says what differs.',
      },
      {
        steps: [
          'System, Devices: Discover. Add the tag that is found.',
          'Open it: Radio shows what it is set to, and what the anchors in range are set to.',
          'Change the tag to what the anchors have. Change anchors only when all of them can be reached: one that is left behind is lost to the others.',
          'Apply, and wait for the check: settings that do not come back are rolled back by themselves.',
        ],
      },
      {
        list: [
          'Longer preamble and lower bit rate reach further and measure less often.',
          'Channels 1 to 3 go through walls a little better than 5 and 7.',
          'More gain than the rules of your country allow is not only illegal: it saturates receivers nearby.',
        ],
      },
    ],
  },
  {
    id: 'preflight',
    title: 'Before take-off',
    group: 'Fly',
    blocks: [
      {
        steps: [
          'Plan: outline, fence, waypoints. The check must read CAN BE FLOWN.',
          'Batteries of aircraft, remote control, base and this device.',
          'Live, Checklist: red items name what is missing. Automatic ones turn green by themselves; the others are confirmed by a person.',
          'People clear, airspace free, pilot with the remote control in hand: the pilot wins at any time.',
          'Sound on: tap the sound chip once, or alarms stay silent.',
          'Take control, then hold Start for a second.',
        ],
      },
      { h: 'In flight' },
      {
        list: [
          'Hold stops the aircraft where it is, at one tap, always.',
          'When the page loses the server the aircraft goes on with its procedure; its own failsafe brings it back when the server loses the aircraft.',
          'Return flies home and lands; Land lands where it is.',
        ],
      },
    ],
  },
  {
    id: 'landed',
    title: 'After landing: review and publish',
    group: 'Fly',
    blocks: [
      {
        p: 'The server solves all ranges of the flight again, together, as soon as the aircraft is down. Nothing is published by itself.',
      },
      {
        steps: [
          'Live or Anchors: Review.',
          'Press an anchor to see why: gates, error budget, residuals, its place among the others, what was published before.',
          'Reject what you do not believe, with a word why. An anchor that fails a gate goes out only with a reason.',
          'Fly again makes a plan for the anchors that lack something.',
          'Publish: one revision, which facility tools read. The report is the page to hand over.',
        ],
      },
    ],
  },
  {
    id: 'live',
    title: 'Live',
    group: 'Screens',
    blocks: [
      { p: 'The flight as it is. Grey and struck is old, with its age; nothing old looks live.' },
      {
        head: ['On the map', 'Means'],
        rows: [
          ['Ring and dot, check, filled', 'estimating, converged, accepted'],
          ['Half-filled ring, broken ring', 'ambiguous: the anchor and its mirror solution, with odds'],
          ['Ellipse', '95 % region, enlarged as the second scale bar says'],
          ['Line to the aircraft', 'a range: solid LOS, dashed NLOS, dotted unclear'],
          ['Squares', 'where measuring next is worth most: larger is better'],
          ['Trail', 'green FIX, dashed FLOAT, dotted SINGLE'],
        ],
      },
      {
        p:
          'Side shows the same from the side: heights are half of the answer. Turn it with ±15°, or look along the building. The ' +
          'bar on an anchor is its 95 % interval.',
      },
      { p: 'Procedure says which step is flown and why; Next point, where to and what it is expected to bring.' },
    ],
  },
  {
    id: 'plan',
    title: 'Plan',
    group: 'Screens',
    blocks: [
      {
        steps: [
          'Outline: tap the corners. Or carry the rover: Corner here sets one at its place, Walk it takes the whole outline while you go round once.',
          'Fence: what the aircraft never leaves. No-fly: what it never enters.',
          'Generate proposes a flight; every point can be moved, by finger, arrows or numbers.',
          'Expected of anchors inside shows what the flight would bring, before it is flown.',
          'Save. What is flown is the saved revision.',
        ],
      },
      {
        p: 'Side shows the route between the lowest and the highest height, and the roof. Heights are above the ground of the take-off.',
      },
    ],
  },
  {
    id: 'anchors',
    title: 'Anchors',
    group: 'Screens',
    blocks: [
      { p: 'Live estimates are of the flight that is shown. Published is the revision that facility tools read.' },
      {
        list: [
          'σ is one sigma; ± and ellipses are 95 %.',
          'Relative is against the base; absolute adds how well the base itself is known.',
          'Acceptance gates: each with its value and limit. One that fails withholds the anchor.',
          'Residuals: what each range says against the answer. A curve over bearing is a lever arm or a wall.',
        ],
      },
    ],
  },
  {
    id: 'measurements',
    title: 'Measure',
    group: 'Screens',
    blocks: [
      {
        p:
          'Every range that was stored, filtered and drawn: distance against RSS, features, impulse responses. A row can be taken ' +
          'out of use with a reason, and back.',
      },
      {
        p: 'Campaign takes ranges with known truth, to train models from: say distance, line of sight and wall, then take n samples.',
      },
    ],
  },
  {
    id: 'models',
    title: 'Models',
    group: 'Screens',
    blocks: [
      {
        p:
          'A model says of each range whether it came through a wall, and how much too long it is. Without one, class reads unclear' +
          ' and nothing is corrected.',
      },
      {
        list: [
          'False positives, a wall taken for line of sight, are worst: they are printed large.',
          'Test data must be of other places than training data; shared ones are called a leak.',
          'Promote takes effect with the next range. Roll back is one press.',
        ],
      },
    ],
  },
  {
    id: 'replay',
    title: 'Replay',
    group: 'Screens',
    blocks: [
      {
        p:
          'A stored flight at any moment of it. Space plays, arrows step, comma and dot go to the previous and next event. The ' +
          'strip says REPLAY and its time: nothing in it is live.',
      },
    ],
  },
  {
    id: 'system',
    title: 'System',
    group: 'Screens',
    blocks: [
      {
        p: 'Devices with what each stands for and what to do; radio settings; base and datum; lever arms; clocks; flights and their bin; access.',
      },
      { p: 'A device that is LATE or LOST names its reason: power, cable, port, settings.' },
    ],
  },
  {
    id: 'withheld',
    title: 'An anchor is withheld',
    group: 'When something is missing',
    blocks: [
      {
        p: 'Withheld means: measured, and not good enough to be published. Its reason is in the review and in its detail.',
      },
      {
        head: ['It says', 'It means', 'Do'],
        rows: [
          [
            'Ambiguous',
            'a mirror solution fits as well: seen from one side, or at one height',
            'Fly again on another side and at another height',
          ],
          [
            'Weak geometry',
            'all measuring points lie in one line or plane with it',
            'Points on two more sides; a height search',
          ],
          [
            'Too few ranges',
            'out of reach, or behind several walls',
            'Fly nearer, dwell longer; check that it has power',
          ],
          [
            'The two halves disagree',
            'it was moved, or the track slipped',
            'Look at the track around that time; fly again',
          ],
          [
            'Residuals are large',
            'walls on all ways, wrong lever arm, wrong radio',
            'Check the lever arm; compare with the other anchors',
          ],
          [
            'A wrong lever arm would not show',
            'the aircraft kept one heading, or the track has none',
            'Fly 20 s or more with the heading a quarter turn away; or say how well the arm was measured, with the flight or in Review',
          ],
          [
            'Not converged in time',
            'its accuracy was not reached before the plan ended',
            'Fly again for it alone; or accept it with a reason',
          ],
        ],
      },
      {
        p: 'Fly again, in the review, makes the plan: points near those anchors on all sides, with a turn and a height search for each.',
      },
    ],
  },
  {
    id: 'nothing',
    title: 'Nothing is measured',
    group: 'When something is missing',
    blocks: [
      {
        head: ['Seen', 'Do'],
        rows: [
          [
            'No range',
            'Tag powered and plugged in? System, Devices: its state and reason. Radio settings as the anchors?',
          ],
          ['NO FIX or SINGLE', 'Free view of the sky; corrections arriving? System, Devices: NTRIP'],
          ['FLOAT for minutes', 'Wait with the antenna still; base further than 20 km? Metal near the antenna?'],
          ['Estimates do not come', 'Positions must arrive too: a range waits for the position after it'],
          ['LINK LOST', 'Wi-Fi of this device. The aircraft goes on by itself; use the remote control if in doubt'],
        ],
      },
    ],
  },
];
export const page_of = (id: string | null): Page => PAGES.find((p) => p.id === id) ?? PAGES[0]!;
/// The page for what is on the screen.
export function page_for(hash: string): string {
  const view = /^#\/?(\w+)/.exec(hash)?.[1] ?? 'live';
  return PAGES.some((p) => p.id === view) ? view : 'live';
}
