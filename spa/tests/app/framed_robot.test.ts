import { expect, it } from 'vitest';
import { framedRobot } from '../../src/app/pages/embed/EmbedPage.tsx';

it.each([
  ['/embed/hubo', '', 'hubo'],
  ['/lab/embed/hubo', '#/r/hubo?theme=light', 'hubo'],
  ['/embed/', '#/r/hubo', 'hubo'],
  ['/embed/index.html', '#/r/hubo', 'hubo'],
  ['/embed/', '', null],
  // the page's headers are for the robot that the path names
  ['/embed/open', '#/r/hubo', null],
  ['/embed/%6fpen', '#/r/hubo', null],
  ['/embed/%6fpen', '', null],
  ['/embed//open', '#/r/hubo', null],
])('%s%s shows %s', (pathname, hash, robot) => {
  expect(framedRobot(pathname, hash)).toBe(robot);
});
