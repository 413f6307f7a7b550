// What a part of the page needs before it is drawn.
import { styled } from "../dom.js";
import { readArm } from "../server.js";

/** Return the answer `arm` once the style beside a module is there too; see `styled`. @param {string} name @param {string} url */
export const armWithStyle = async (name, url) => (await Promise.all([readArm(), styled(name, url)]))[0];
