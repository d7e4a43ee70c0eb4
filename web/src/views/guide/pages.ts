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
    id: 'first',
    title: 'The first flight',
    group: 'Set up',
    blocks: [
      { p: 'There are three ways to start; none needs the internet.' },
      {
        list: [
          'Fly the demonstration: the server simulates a drone and six anchors. Positions come within a minute.',
          'Connect my devices: the tag, the receiver and the corrections, step by step, each checked while it measures. New flight then' +
            ' records what they measure, until Finish the recording in Live.',
          'Import a flight: a folder, tables or a .zip of a flight that has already been flown.',
        ],
      },
    ],
  },
  {
    id: 'connect',
    title: 'Connect the devices',
    group: 'Set up',
    blocks: [
      {
        steps: [
          'Plug in the UWB tag and the RTK receiver. System, Devices: Discover lists what is found at the ports.',
          'Add what was found. What is not found by itself is added by hand: kind, port or address.',
          'Choose a name under by-id for a serial port: it stays when the plug moves.',
          'Add the source of corrections (NTRIP), where the receiver does not have its own.',
          'Wait for LIVE. LATE and LOST name their reason: power, cable, port, settings.',
          'Compare the radio of the tag with that of the anchors in range.',
        ],
      },
      { p: 'A change reconnects the device; measurements of that moment are missing from the flight.' },
    ],
  },
  {
    id: 'mounting',
    title: 'Mount the tag and the receiver',
    group: 'Set up',
    blocks: [
      {
        p:
          'The UWB tag measures distances, the RTK receiver its own position. Both are fixed to the aircraft so that neither moves ' +
          'against the other.',
      },
      {
        steps: [
          'Fix the GNSS antenna on top, level, with a free view of the sky and its ground plane under it.',
          'Fix the tag below or at a side, antenna upright, at least 10 cm from carbon, batteries and motors: carbon attenuates by 10 dB and more.',
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
          ' in metres. An error of 5 cm moves every anchor by up to 5 cm, regardless of everything else.',
      },
      {
        steps: [
          'Put the aircraft level. Forward is where its nose points.',
          "Measure from the middle of the GNSS antenna's phase centre (its label gives the height above the mount) to the middle of the tag's antenna.",
          'Forward and left are positive; below the antenna is negative. Example: 12 cm ahead, 28 cm below is 0.12, 0, −0.28.',
          'State the accuracy: one sigma of the forward and left part. With a tape measure 0.02 m; by eye 0.05 m; from the drawing of the mount 0.005 m.',
          'Give both with the flight: in New flight (System, Flights), in Import a flight, or as tags and lever_arm_sigma_m of POST /missions' +
            ' and of flight.json. System, Lever arms, shows them.',
          'Where they were wrong, correct them after landing (System, Flights, Correct), and calibrate again.',
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
        p: 'Anchors are as accurate as the base: relative to it within centimetres, globally only as well as the coordinates of the base are known.',
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
      {
        p: 'FLOAT is a position without fixed ambiguities, with errors of decimetres. Its ranges are stored and weighted little.',
      },
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
          ' compares the tag with every anchor in its range and shows what differs.',
      },
      {
        steps: [
          'System, Devices: Discover. Add the tag that is found.',
          'Open it: Radio shows what it is set to, and what the anchors in range are set to.',
          'Change the tag to what the anchors have. Change anchors only when all of them can be reached: one that is left out loses contact with the others.',
          'Apply, and wait for the check: settings that cannot be verified are rolled back automatically.',
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
    id: 'import',
    title: 'Import a flight',
    group: 'Set up',
    blocks: [
      {
        steps: [
          'Drop the folder of the flight (flight.json, track.csv, ranges.csv), its two tables, or either as .zip.',
          'Assign the columns that are not recognised by their name: time, position, distance, address of the anchor.',
          'Give the coordinate system of map positions (EPSG code or zone), and the reference of the heights if their column does not show it.',
          'Give the point of the aircraft that the track describes, and where the antenna of the tag is from there: forward, left, up.',
          'Import: its rows are stored, its anchors are estimated and shown in Anchors.',
        ],
      },
      { p: 'Rows that are rejected are counted, with the first reason.' },
    ],
  },
  {
    id: 'floor-plan',
    title: 'Floor plans',
    group: 'Set up',
    blocks: [
      { p: 'A floor plan lies under the maps, and its traced walls count where the next point is chosen.' },
      {
        steps: [
          'Plan, Floor plan: choose the floor, or make one.',
          'Send the picture: PNG, JPEG, GeoTIFF, a page of a PDF, or a DXF drawing.',
          'Click three or more corners far apart and give the place of each; a fourth, or the measured length between the first two, shows which one is wrong.',
          'Trace finds outline and walls: choose the material of the walls and accept them, or use the outline for the plan.',
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
          'System, Flights, New flight: name, site, kit, lever arms as measured. It records from then on, also what a pilot flies by hand.',
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
          'When the page loses the server, the aircraft continues its procedure; when the server loses the aircraft, its own failsafe brings it back.',
          'Return flies home and lands; Land lands where it is.',
        ],
      },
    ],
  },
  {
    id: 'plan-change',
    title: 'Change the plan in flight',
    group: 'Fly',
    blocks: [
      {
        steps: [
          'Edit and save the plan. What is flown stays as it was; a notice says that another revision is saved.',
          'Review the change: what differs, the remaining flight with either revision, and why it is refused, if it is.',
          'With control, hold Fly revision for a second: it is flown from the next waypoint.',
          'Undo goes back to the revision that was flown before.',
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
          'Reject what you do not trust, with a reason. An anchor that fails a gate is published only with a reason.',
          'Fly again makes a plan for the anchors that are not good enough.',
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
          'Side shows the same from the side: heights matter as much as the plane. Turn it with ±15°, or look along the building. The ' +
          'bar on an anchor is its 95 % interval.',
      },
      { p: 'Procedure says which step is flown and why; Next point, where to and how much it is expected to improve.' },
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
          'Expected of anchors inside shows the accuracy of the flight before it is flown.',
          'Save. What is flown is the saved revision.',
        ],
      },
      {
        p: 'Side shows the route between the lowest and the highest height, and the roof. Heights are above the ground of the take-off.',
      },
    ],
  },
  {
    id: 'conflict',
    title: 'Two people changed one plan',
    group: 'Screens',
    blocks: [
      { p: 'Somebody else saved this plan while it was open here. Both versions are shown, drawn to one scale.' },
      {
        list: [
          'Take theirs: your changes are discarded.',
          'Keep mine, then save: their version is replaced.',
          'Decide later: nothing is saved; the next saving asks again.',
        ],
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
          'Relative is relative to the base; absolute includes the uncertainty of the base itself.',
          'Acceptance gates: each with its value and limit. One that fails withholds the anchor.',
          'Residuals: how far each range is from the solution. A curve over bearing is a lever arm or a wall.',
        ],
      },
    ],
  },
  {
    id: 'compare',
    title: 'Compare two calibrations',
    group: 'Screens',
    blocks: [
      { p: 'Both are shown as the shift of each anchor that they have in common, in millimetres east, north and up.' },
      {
        list: [
          'MOVED: further than both covariances allow (99.9 %). The anchor was moved, or one of the two is wrong.',
          'All of them shifted by the same amount: the position of the base changed, the anchors did not move.',
          'NOT COMPARABLE: one of the two has no position of it.',
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
      { p: 'Label in the field records ranges with known truth, to train models from.' },
    ],
  },
  {
    id: 'campaign',
    title: 'Label in the field',
    group: 'Screens',
    blocks: [
      { p: 'Ranges with known truth are what models are trained from. They are kept as campaigns.' },
      {
        steps: [
          'Stand still, with the tag where it measures in flight. Measure the true distance with a laser metre.',
          'Type distance, line of sight or not, and the wall between: material and thickness.',
          'Record: the next ranges of the anchor join the campaign with this truth.',
          'Go to the next place; the form stays filled in. Other rooms are needed to test a model on.',
        ],
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
          'A model predicts of each range whether it came through a wall, and how much too long it is. Without one, class reads unclear' +
          ' and nothing is corrected.',
      },
      {
        list: [
          'False positives, a wall taken for line of sight, are the worst errors: they are shown large.',
          'Test data must come from other places than training data; shared places are called a leak.',
          'Promote takes effect with the next range. Roll back needs one press.',
        ],
      },
    ],
  },
  {
    id: 'promote',
    title: 'Promote a model',
    group: 'Screens',
    blocks: [
      { p: 'A promoted model predicts every live range, from the next one on.' },
      {
        list: [
          'The gate compares it with the active model on the same test data: false positives and mean error may not get worse.',
          'A gate that is not passed needs a reason, which is kept in the audit log.',
          'Roll back makes the one before active again, at one press.',
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
      {
        p:
          'Procedure, next point with its candidates, turns and height searches are what Live showed at that moment. Of a flight ' +
          'that was imported without them, the events alone say where it stood.',
      },
    ],
  },
  {
    id: 'system',
    title: 'System',
    group: 'Screens',
    blocks: [
      {
        p: 'Devices with their state and what to do; radio settings; base and datum; lever arms; clocks; flights and their bin; access.',
      },
      { p: 'A device that is LATE or LOST names its reason: power, cable, port, settings.' },
    ],
  },
  {
    id: 'strip',
    title: 'The status strip',
    group: 'Screens',
    blocks: [
      { p: 'Six tiles in the same order on every view. Each opens a card with the reason and what to do.' },
      {
        head: ['Tile', 'Shows'],
        rows: [
          ['Link', 'LIVE; LATE after 2 s without new data; LOST after 5 s: then every value is struck, with its age'],
          ['RTK', 'FIX: centimetres; FLOAT: decimetres; DGPS, SINGLE: metres; and the age of corrections'],
          ['UWB', 'anchors in range in the last 2 s, of all that were seen in this flight'],
          ['Drone', 'battery and mode; without a link to the autopilot, height and speed'],
          ['Recording', 'how long this flight is recorded'],
          ['Alarms', 'how many stand'],
        ],
      },
    ],
  },
  {
    id: 'access',
    title: 'Who may do what',
    group: 'Screens',
    blocks: [
      {
        p:
          'A token says who you are. An admin makes one in System, Access, or with anchord token create; it is shown once.' +
          ' Without tokens the server answers its own machine only.',
      },
    ],
  },
  {
    id: 'alarms',
    title: 'Alarms',
    group: 'When something is missing',
    blocks: [
      {
        list: [
          'The line under the strip shows the most urgent one with what to do; the list has all of them.',
          'Acknowledge makes one quiet; it stays listed until it is over.',
          'Critical ones sound until they are acknowledged, a warning once; Mute is for two minutes.',
          'Sound needs one tap on the sound chip: a browser is silent before.',
          'While the link is lost alarms read when last seen: nothing is assessed without data.',
        ],
      },
    ],
  },
  {
    id: 'withheld',
    title: 'An anchor is withheld',
    group: 'When something is missing',
    blocks: [
      {
        p: 'Withheld means: measured, but not good enough to be published. Its reason is in the review and in its detail.',
      },
      {
        head: ['Reason', 'Meaning', 'Do'],
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
            'it was moved, or the track was shifted',
            'Look at the track around that time; fly again',
          ],
          [
            'A part of its ranges agrees on another position',
            'it was moved, its address was exchanged, or a reflection was received in place of the direct signal',
            'Read since when in its detail; set addresses right; fly it again, with a free line of sight',
          ],
          [
            'Its ranges are too long or too short, unlike those of the other anchors',
            'another antenna delay, cable or firmware, or a wall close to it',
            'Set its antenna delay as on the others; move it away from the wall; fly again',
          ],
          [
            'A part of the track is shifted',
            'RTK fixed wrongly after a gap, or the base position changed',
            'Exclude the positions before or after the gap, whichever is wrong; else fly again',
          ],
          [
            'Residuals are large',
            'walls in all directions, wrong lever arm, wrong radio settings',
            'Check the lever arm; compare with the other anchors',
          ],
          [
            'A wrong lever arm would not show',
            'the aircraft kept one heading, or the track has none',
            'Fly 20 s or more with the heading a quarter turn away; or state how well the lever arm was measured, with the flight or in Review',
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
          ['LINK LOST', 'Wi-Fi of this device. The aircraft continues by itself; use the remote control if in doubt'],
        ],
      },
    ],
  },
];
export const page_of = (id: string | null): Page => PAGES.find((p) => p.id === id) ?? PAGES[0]!;
/// The page of this name, or for what is at this address: `#/system/connect` has one of its own, a page of the guide is its own.
export function page_for(name_or_hash: string): string {
  const [view = 'live', part = ''] = name_or_hash.replace(/^#\/?|\?.*/g, '').split('/'),
    known = (id: string): boolean => PAGES.some((p) => p.id === id);
  return [part, view].find(known) ?? 'live';
}
