/** The built-in scenes, by id, in the order of the menu. */
import clothOnBox from '../../scenes/cloth-on-box.json';
import clouds24 from '../../scenes/clouds-24.json';
import line4 from '../../scenes/line-4.json';
import overtake8 from '../../scenes/overtake-8.json';
import parade8 from '../../scenes/parade-8.json';
import points64 from '../../scenes/points-64.json';
import spheres from '../../scenes/spheres.json';
import strip4 from '../../scenes/strip-4.json';
import swarms12 from '../../scenes/swarms-12.json';
import ties6 from '../../scenes/ties-6.json';
import translation8 from '../../scenes/translation-8.json';

export const builtIn = {
  'line-4': line4, 'overtake-8': overtake8, 'parade-8': parade8, 'translation-8': translation8, 'ties-6': ties6,
  'strip-4': strip4, 'swarms-12': swarms12, 'clouds-24': clouds24, 'points-64': points64,
  'cloth-on-box': clothOnBox, 'spheres': spheres,
};

/** Returns a built-in scene; throws an Error that lists the known ids. */
export function sceneById(id) {
  if (!builtIn[id]) throw new Error(`there is no built-in scene '${id}'; known are ${Object.keys(builtIn).join(', ')}`);
  return builtIn[id];
}
