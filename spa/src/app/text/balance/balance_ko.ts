import type { balanceEn } from './balance_en.ts';

/** The Korean sentences of `balance_en.ts`. */
export const balanceKo: typeof balanceEn = {
  balance: '균형',
  balanceWhat: '어느 쪽으로 넘어질지, 무엇을 딛고 있는지',

  inside: (mm) => `무게중심이 딛고 있는 자리의 가장자리에서 ${mm} 안쪽에 있습니다.`,
  wasInside: (mm) => `무게중심이 딛고 있던 자리의 가장자리에서 ${mm} 안쪽에 있었습니다.`,
  edge: '무게중심이 딛고 있는 자리의 가장자리 위에 있습니다.',
  wasEdge: '무게중심이 딛고 있던 자리의 가장자리 위에 있었습니다.',
  forwards: (mm) => `앞으로 넘어질 상태입니다: 무게중심이 ${mm} 벗어나 있습니다.`,
  backwards: (mm) => `뒤로 넘어질 상태입니다: 무게중심이 ${mm} 벗어나 있습니다.`,
  left: (mm) => `로봇의 왼쪽으로 넘어질 상태입니다: 무게중심이 ${mm} 벗어나 있습니다.`,
  right: (mm) => `로봇의 오른쪽으로 넘어질 상태입니다: 무게중심이 ${mm} 벗어나 있습니다.`,
  wasOutside: (mm) => `무게중심이 딛고 있던 자리에서 ${mm} 벗어나 있었습니다.`,
  moving: (mm) => `움직이는 중입니다: 무게중심이 ${mm} 벗어나 있지만, 두 발 위에서 멈추게 됩니다.`,
  wasMoving: (mm) =>
    `움직이는 중이었습니다: 무게중심이 ${mm} 벗어나 있었지만, 두 발 위에서 멈출 상태였습니다.`,
  airborne: '체중을 받치는 발이 없습니다.',
  wasAirborne: '체중을 받치는 발이 없었습니다.',
  unread: '힘 측정값이 없는 발이 있어, 무엇을 딛고 있는지 알 수 없습니다.',
  orientationUnread: '몸의 기울기 측정값이 없어, 어떻게 서 있는지 알 수 없습니다.',
  jointUnread: '무게가 걸리는 관절의 측정값이 없어, 어떻게 서 있는지 알 수 없습니다.',
  assumed: '가장 낮은 발을 딛고 있다고 가정합니다. 이를 재는 센서가 없습니다.',

  briefInside: (mm) => `안쪽 ${mm}`,
  briefEdge: '가장자리 위',
  briefOutside: (mm) => `바깥쪽 ${mm}`,
  briefMoving: (mm) => `바깥쪽 ${mm}, 움직이는 중`,
  briefAirborne: '받치는 발 없음',
  briefUnread: '측정값 없음',

  builtBefore: '질량 없이 빌드한 모델입니다. 다시 빌드하세요.',
  rawModel: '파일을 그대로 보여 주는 모델이라 발바닥을 알 수 없습니다. 빌드한 모델에는 발바닥이 있습니다.',
  noMasses: '로봇의 설명 파일에 질량이 없습니다.',
  impossibleMasses: '로봇의 설명 파일에 있을 수 없는 질량이 있습니다.',
  noFeet: '팔, 바퀴, 거치대처럼 알려진 발이 없는 로봇입니다. 발은 프로필의 [balance]에 적으세요.',
  noForce: '어느 발이 체중을 받치는지 알 수 없습니다: 힘(Fz)을 재지 않는 발이 있습니다.',
  noPressure: '압력중심을 알 수 없습니다: 힘과 모멘트(Fz, Mx, My)를 모두 재지 않는 발이 있습니다.',

  margin: '여유',
  massX: '무게중심 x',
  massY: '무게중심 y',
  massZ: '무게중심 z',
  pressureX: '압력중심 x',
  pressureY: '압력중심 y',
  mass: '질량',
  toPlots: '그래프에 넣거나 빼기',
  withoutLimit: '기본값: 20 mm 미만은 노랑, 벗어나면 빨강입니다.',

  room: '한계까지 남은 거리',
  roomWhat: '끝에 닿기까지 더 움직일 수 있는 만큼.',
  toLower: (value) => `아래쪽 한계까지 ${value}`,
  toUpper: (value) => `위쪽 한계까지 ${value}`,
  beyondLower: (value) => `아래쪽 한계를 ${value} 넘음`,
  beyondUpper: (value) => `위쪽 한계를 ${value} 넘음`,
  ofItsWay: (percent) => `움직일 수 있는 범위의 ${percent}`,
};
