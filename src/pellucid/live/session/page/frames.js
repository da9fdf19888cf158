// Times of this page's frames, as the browser tells them. They say when a frame was drawn, not when its light left the
// screen: that takes a photodiode on the patch in the corner.
"use strict";
const frameTimes = { intervals: [], all: [], last: 0 };

function onFrame(time) {
  if (frameTimes.last > 0) {
    frameTimes.intervals.push(time - frameTimes.last);
    if (frameTimes.all.length < 60000) frameTimes.all.push(time - frameTimes.last);
  }
  frameTimes.last = time;
  if (window.drawFrame) window.drawFrame(time);
  requestAnimationFrame(onFrame);
}
requestAnimationFrame(onFrame);
