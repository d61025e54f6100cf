async function He(r,s){let e=new Blob([r]).stream().pipeThrough(s);return new Uint8Array(await new Response(e).arrayBuffer())}async function ze(r){let s=new TextEncoder().encode(JSON.stringify(r)),e=await He(s,new CompressionStream("deflate-raw")),t="";for(let i of e)t+=String.fromCharCode(i);return"#d="+btoa(t).replaceAll("+","-").replaceAll("/","_").replace(/=+$/,"")}async function he(r){let s=/^#d=([\w-]+)$/.exec(r);if(!s)return null;try{let e=atob(s[1].replaceAll("-","+").replaceAll("_","/")),t=Uint8Array.from(e,n=>n.charCodeAt(0)),i=await He(t,new DecompressionStream("deflate-raw"));return JSON.parse(new TextDecoder().decode(i))}catch{return null}}var kt=150,St=250,Et=2e5,Y=class extends EventTarget{constructor(e,t={}){super();this.host=e;this.options=t;this.open=!1;this.wasOpen=!1;this.parts=null;this.document=null;this.side=null;this.notes=[];this.canUndo=!1;this.canRedo=!1;this.selected="sensor";this.picture=null;this.pinned=null;this.value=null;this.views=null;this.without=null;this.refused=null;this.progress=null;this.answer=null;this.waiting=!1;this.turn=0;this.selectAt=1/0;this.selectThen="sensor";this.accepted=null;this.next=null;this.underway=0;this.timer=0;this.addressTimer=0;this.pictures=0;this.latestPicture=0;this.valueUnderway=!1;this.nextValue=null;this.addressChanged=async()=>{let e=await he(window.location.hash);e&&this.act({do:"load",document:e})};e.onmessage=(i,n)=>{this.hear(i,n)},e.onstate=i=>{this.connection(i)}}start(){this.options.address&&window.addEventListener("hashchange",this.addressChanged),this.host.start()}close(){window.removeEventListener("hashchange",this.addressChanged),window.clearTimeout(this.timer),window.clearTimeout(this.addressTimer),this.host.close()}set(e,t,i=!1){this.document&&(this.document=At(this.document,e,t)),i?(this.next={where:e,value:t},this.underway||this.sendNext()):(this.next=null,this.settle(),this.ask({do:"set",where:e,value:t,moving:!1})),this.changed()}act(e,t){this.next=null,this.settle(),this.ask(e,t),this.changed()}add(e,t){this.selectThen=this.elements.length,this.act({do:"add",kind:e,z:t}),this.selectAt=this.turn}duplicate(e){this.selectThen=e+1,this.act({do:"duplicate",element:e}),this.selectAt=this.turn}askValue(e,t){this.nextValue=[e,t],!this.valueUnderway&&(this.valueUnderway=!0,this.host.send({do:"value",x:e,y:t}),this.nextValue=null)}question(e,t={}){this.host.send({do:"ask",what:e,...t})}export(e,t={}){this.host.send({do:"export",what:e,...t})}pin(e){this.host.send({do:"pin",on:e}),e||(this.pinned=null,this.changed())}select(e){this.selected!==e&&(this.selected=e,this.changed())}forgive(){this.refused=null,this.changed()}get elements(){return this.document?.camera.elements??[]}partOf(e){if(e!=="light field")return e==="sensor"?this.side?.sensor:this.side?.elements[e]}whereOf(e){return e==="sensor"?["sensor"]:["elements",e]}notesOf(e){return this.notes.filter(t=>t.element===e)}async connection(e){if(this.open=e==="open",this.settle(),this.valueUnderway=!1,this.open){let t=this.document??(this.options.address?await he(window.location.hash):null);this.wasOpen=!0,this.ask({do:"hello",...t?{document:t}:{}})}else this.progress=null,this.waiting=!1;this.changed()}async hear(e,t){switch(e.is){case"parts":this.parts=e;break;case"state":this.side=e.side,this.views=e.grid?[e.grid[0],e.grid[1]]:null,this.canUndo=e.undo,this.canRedo=e.redo,this.accepted=e.document,e.turn>=this.turn&&!this.next&&(this.document=e.document,this.keepAddress()),e.turn>=this.selectAt&&(this.selectAt=1/0,this.selected=this.selectThen),typeof this.selected=="number"&&this.selected>=this.side.elements.length&&(this.selected=this.side.elements.length?this.side.elements.length-1:"sensor");break;case"notes":e.turn>=this.turn&&(this.notes=e.notes);break;case"no picture":this.without=e.words,this.waiting=!1,this.progress=null,this.settle(),this.sendNext();break;case"failed":this.refused={words:e.words,where:null},this.waiting=!1,this.progress=null,this.settle(),this.sendNext();break;case"picture":e.turn>=this.turn&&!e.coarse&&(this.waiting=!1),this.without=null,this.progress=null,e.turn>=this.underway&&(this.settle(),this.sendNext()),await this.show(e,t[0]);break;case"pinned":this.pinned?.close(),this.pinned=t[0]?await Ne(t[0]):null,this.picture&&(this.picture.about={...this.picture.about,same:this.pinned!==null});break;case"value":this.value=e,this.valueUnderway=!1,this.nextValue&&this.askValue(...this.nextValue);break;case"answer":for(let i of this.answer?.pictures??[])URL.revokeObjectURL(i);this.answer={message:e,pictures:t.map(i=>URL.createObjectURL(new Blob([pe(i)],{type:"image/jpeg"})))};break;case"file":t[0]&&Mt(e.name,e.type,t[0]),this.progress=null;break;case"refused":this.refused={words:e.words,where:e.where??null},this.selectAt=1/0,this.waiting=!1,this.progress=null,this.valueUnderway=!1,this.settle(),this.next||(this.document=this.accepted),this.sendNext();break;case"progress":this.progress=e.done<e.total?e:null;break}this.changed()}async show(e,t){if(!t)return;let i=++this.pictures,n=await Ne(t);if(i<this.latestPicture){n.close();return}this.latestPicture=i,this.picture?.bitmap.close(),this.picture={bitmap:n,about:e}}sendNext(){if(!this.next)return;let{where:e,value:t}=this.next;this.next=null,this.ask({do:"set",where:e,value:t,moving:!0}),this.underway=this.turn,this.timer=window.setTimeout(()=>{this.underway=0,this.sendNext()},kt)}settle(){window.clearTimeout(this.timer),this.underway=0}ask(e,t){this.turn+=1,this.refused=null,this.waiting=this.open,this.host.send({...e,turn:this.turn},t)}changed(){this.dispatchEvent(new Event("change"))}keepAddress(){this.options.address&&(window.clearTimeout(this.addressTimer),this.addressTimer=window.setTimeout(async()=>{if(!this.document)return;let{pathname:e,search:t}=window.location,i=await ze(this.document);window.history.replaceState(null,"",e+t+(i.length<Et?i:""))},St))}};function At(r,s,e){let t=s[0]==="elements"||s[0]==="sensor";return de(r,t?["camera",...s]:s,e,t)}function de(r,s,e,t){if(!s.length)return e;let[i,...n]=s;if(Array.isArray(r))return r.map((a,l)=>l===i?de(a,n,e,t):a);if(typeof r!="object"||r===null)return r;let o={...r,[i]:de(r[i]??null,n,e,t)};return t&&o[i]===null&&delete o[i],o}function pe(r){return new Uint8Array(r.buffer,r.byteOffset,r.byteLength)}function Ne(r){return createImageBitmap(new Blob([pe(r)],{type:"image/jpeg"}))}function Mt(r,s,e){let t=URL.createObjectURL(new Blob([pe(e)],{type:s})),i=document.createElement("a");i.href=t,i.download=r,i.click(),window.setTimeout(()=>URL.revokeObjectURL(t),1e4)}function _t(r,s=[]){let e=new TextEncoder().encode(JSON.stringify({...r,buffers:s.map(o=>o.byteLength)})),t=s.reduce((o,a)=>o+a.byteLength,4+e.length),i=new Uint8Array(t);new DataView(i.buffer).setUint32(0,e.length,!0),i.set(e,4);let n=4+e.length;for(let o of s)i.set(new Uint8Array(o),n),n+=o.byteLength;return i.buffer}function Tt(r){let s=new DataView(r).getUint32(0,!0),e=JSON.parse(new TextDecoder().decode(new Uint8Array(r,4,s))),t=4+s,i=(e.buffers??[]).map(n=>{let o=new DataView(r,t,n);return t+=n,o});return{message:e,buffers:i}}var Ue=300,Pt=3e3,ee=class{constructor(s){this.address=s;this.onmessage=()=>{};this.onstate=()=>{};this.socket=null;this.wait=Ue;this.timer=0;this.ended=!1;this.key=""}start(){let s=new URL(this.address);this.key&&s.searchParams.set("key",this.key);let e=new WebSocket(s);e.binaryType="arraybuffer",this.socket=e,e.onopen=()=>{this.wait=Ue,this.onstate("open")},e.onmessage=t=>{let{message:i,buffers:n}=Tt(t.data);i.is==="key"?this.key=i.key:this.onmessage(i,n)},e.onclose=()=>{this.socket=null,!this.ended&&(this.onstate("closed"),this.timer=window.setTimeout(()=>this.start(),this.wait),this.wait=Math.min(2*this.wait,Pt))}}send(s,e=[]){this.socket?.readyState===WebSocket.OPEN&&this.socket.send(_t(s,e))}close(){this.ended=!0,window.clearTimeout(this.timer),this.socket?.close()}},te=class{constructor(s){this.model=s;this.onmessage=()=>{};this.onstate=()=>{};this.hears=(s,e)=>this.onmessage(s,e??[])}start(){this.model.on("msg:custom",this.hears),this.onstate("open")}send(s,e=[]){this.model.send(s,void 0,e)}close(){this.model.off("msg:custom",this.hears)}};/**
 * @license
 * Copyright 2019 Google LLC
 * SPDX-License-Identifier: BSD-3-Clause
 */var se=globalThis,ie=se.ShadowRoot&&(se.ShadyCSS===void 0||se.ShadyCSS.nativeShadow)&&"adoptedStyleSheets"in Document.prototype&&"replace"in CSSStyleSheet.prototype,ue=Symbol(),De=new WeakMap,V=class{constructor(s,e,t){if(this._$cssResult$=!0,t!==ue)throw Error("CSSResult is not constructable. Use `unsafeCSS` or `css` instead.");this.cssText=s,this.t=e}get styleSheet(){let s=this.o,e=this.t;if(ie&&s===void 0){let t=e!==void 0&&e.length===1;t&&(s=De.get(e)),s===void 0&&((this.o=s=new CSSStyleSheet).replaceSync(this.cssText),t&&De.set(e,s))}return s}toString(){return this.cssText}},Ie=r=>new V(typeof r=="string"?r:r+"",void 0,ue),k=(r,...s)=>{let e=r.length===1?r[0]:s.reduce((t,i,n)=>t+(o=>{if(o._$cssResult$===!0)return o.cssText;if(typeof o=="number")return o;throw Error("Value passed to 'css' function must be a 'css' function result: "+o+". Use 'unsafeCSS' to pass non-literal values, but take care to ensure page security.")})(i)+r[n+1],r[0]);return new V(e,r,ue)},Be=(r,s)=>{if(ie)r.adoptedStyleSheets=s.map(e=>e instanceof CSSStyleSheet?e:e.styleSheet);else for(let e of s){let t=document.createElement("style"),i=se.litNonce;i!==void 0&&t.setAttribute("nonce",i),t.textContent=e.cssText,r.appendChild(t)}},me=ie?r=>r:r=>r instanceof CSSStyleSheet?(s=>{let e="";for(let t of s.cssRules)e+=t.cssText;return Ie(e)})(r):r;/**
 * @license
 * Copyright 2017 Google LLC
 * SPDX-License-Identifier: BSD-3-Clause
 */var{is:Ct,defineProperty:Ot,getOwnPropertyDescriptor:Lt,getOwnPropertyNames:Rt,getOwnPropertySymbols:Ht,getPrototypeOf:zt}=Object,ne=globalThis,We=ne.trustedTypes,Nt=We?We.emptyScript:"",Ut=ne.reactiveElementPolyfillSupport,q=(r,s)=>r,fe={toAttribute(r,s){switch(s){case Boolean:r=r?Nt:null;break;case Object:case Array:r=r==null?r:JSON.stringify(r)}return r},fromAttribute(r,s){let e=r;switch(s){case Boolean:e=r!==null;break;case Number:e=r===null?null:Number(r);break;case Object:case Array:try{e=JSON.parse(r)}catch{e=null}}return e}},je=(r,s)=>!Ct(r,s),Fe={attribute:!0,type:String,converter:fe,reflect:!1,useDefault:!1,hasChanged:je};Symbol.metadata??=Symbol("metadata"),ne.litPropertyMetadata??=new WeakMap;var M=class extends HTMLElement{static addInitializer(s){this._$Ei(),(this.l??=[]).push(s)}static get observedAttributes(){return this.finalize(),this._$Eh&&[...this._$Eh.keys()]}static createProperty(s,e=Fe){if(e.state&&(e.attribute=!1),this._$Ei(),this.prototype.hasOwnProperty(s)&&((e=Object.create(e)).wrapped=!0),this.elementProperties.set(s,e),!e.noAccessor){let t=Symbol(),i=this.getPropertyDescriptor(s,t,e);i!==void 0&&Ot(this.prototype,s,i)}}static getPropertyDescriptor(s,e,t){let{get:i,set:n}=Lt(this.prototype,s)??{get(){return this[e]},set(o){this[e]=o}};return{get:i,set(o){let a=i?.call(this);n?.call(this,o),this.requestUpdate(s,a,t)},configurable:!0,enumerable:!0}}static getPropertyOptions(s){return this.elementProperties.get(s)??Fe}static _$Ei(){if(this.hasOwnProperty(q("elementProperties")))return;let s=zt(this);s.finalize(),s.l!==void 0&&(this.l=[...s.l]),this.elementProperties=new Map(s.elementProperties)}static finalize(){if(this.hasOwnProperty(q("finalized")))return;if(this.finalized=!0,this._$Ei(),this.hasOwnProperty(q("properties"))){let e=this.properties,t=[...Rt(e),...Ht(e)];for(let i of t)this.createProperty(i,e[i])}let s=this[Symbol.metadata];if(s!==null){let e=litPropertyMetadata.get(s);if(e!==void 0)for(let[t,i]of e)this.elementProperties.set(t,i)}this._$Eh=new Map;for(let[e,t]of this.elementProperties){let i=this._$Eu(e,t);i!==void 0&&this._$Eh.set(i,e)}this.elementStyles=this.finalizeStyles(this.styles)}static finalizeStyles(s){let e=[];if(Array.isArray(s)){let t=new Set(s.flat(1/0).reverse());for(let i of t)e.unshift(me(i))}else s!==void 0&&e.push(me(s));return e}static _$Eu(s,e){let t=e.attribute;return t===!1?void 0:typeof t=="string"?t:typeof s=="string"?s.toLowerCase():void 0}constructor(){super(),this._$Ep=void 0,this.isUpdatePending=!1,this.hasUpdated=!1,this._$Em=null,this._$Ev()}_$Ev(){this._$ES=new Promise(s=>this.enableUpdating=s),this._$AL=new Map,this._$E_(),this.requestUpdate(),this.constructor.l?.forEach(s=>s(this))}addController(s){(this._$EO??=new Set).add(s),this.renderRoot!==void 0&&this.isConnected&&s.hostConnected?.()}removeController(s){this._$EO?.delete(s)}_$E_(){let s=new Map,e=this.constructor.elementProperties;for(let t of e.keys())this.hasOwnProperty(t)&&(s.set(t,this[t]),delete this[t]);s.size>0&&(this._$Ep=s)}createRenderRoot(){let s=this.shadowRoot??this.attachShadow(this.constructor.shadowRootOptions);return Be(s,this.constructor.elementStyles),s}connectedCallback(){this.renderRoot??=this.createRenderRoot(),this.enableUpdating(!0),this._$EO?.forEach(s=>s.hostConnected?.())}enableUpdating(s){}disconnectedCallback(){this._$EO?.forEach(s=>s.hostDisconnected?.())}attributeChangedCallback(s,e,t){this._$AK(s,t)}_$ET(s,e){let t=this.constructor.elementProperties.get(s),i=this.constructor._$Eu(s,t);if(i!==void 0&&t.reflect===!0){let n=(t.converter?.toAttribute!==void 0?t.converter:fe).toAttribute(e,t.type);this._$Em=s,n==null?this.removeAttribute(i):this.setAttribute(i,n),this._$Em=null}}_$AK(s,e){let t=this.constructor,i=t._$Eh.get(s);if(i!==void 0&&this._$Em!==i){let n=t.getPropertyOptions(i),o=typeof n.converter=="function"?{fromAttribute:n.converter}:n.converter?.fromAttribute!==void 0?n.converter:fe;this._$Em=i;let a=o.fromAttribute(e,n.type);this[i]=a??this._$Ej?.get(i)??a,this._$Em=null}}requestUpdate(s,e,t,i=!1,n){if(s!==void 0){let o=this.constructor;if(i===!1&&(n=this[s]),t??=o.getPropertyOptions(s),!((t.hasChanged??je)(n,e)||t.useDefault&&t.reflect&&n===this._$Ej?.get(s)&&!this.hasAttribute(o._$Eu(s,t))))return;this.C(s,e,t)}this.isUpdatePending===!1&&(this._$ES=this._$EP())}C(s,e,{useDefault:t,reflect:i,wrapped:n},o){t&&!(this._$Ej??=new Map).has(s)&&(this._$Ej.set(s,o??e??this[s]),n!==!0||o!==void 0)||(this._$AL.has(s)||(this.hasUpdated||t||(e=void 0),this._$AL.set(s,e)),i===!0&&this._$Em!==s&&(this._$Eq??=new Set).add(s))}async _$EP(){this.isUpdatePending=!0;try{await this._$ES}catch(e){Promise.reject(e)}let s=this.scheduleUpdate();return s!=null&&await s,!this.isUpdatePending}scheduleUpdate(){return this.performUpdate()}performUpdate(){if(!this.isUpdatePending)return;if(!this.hasUpdated){if(this.renderRoot??=this.createRenderRoot(),this._$Ep){for(let[i,n]of this._$Ep)this[i]=n;this._$Ep=void 0}let t=this.constructor.elementProperties;if(t.size>0)for(let[i,n]of t){let{wrapped:o}=n,a=this[i];o!==!0||this._$AL.has(i)||a===void 0||this.C(i,void 0,n,a)}}let s=!1,e=this._$AL;try{s=this.shouldUpdate(e),s?(this.willUpdate(e),this._$EO?.forEach(t=>t.hostUpdate?.()),this.update(e)):this._$EM()}catch(t){throw s=!1,this._$EM(),t}s&&this._$AE(e)}willUpdate(s){}_$AE(s){this._$EO?.forEach(e=>e.hostUpdated?.()),this.hasUpdated||(this.hasUpdated=!0,this.firstUpdated(s)),this.updated(s)}_$EM(){this._$AL=new Map,this.isUpdatePending=!1}get updateComplete(){return this.getUpdateComplete()}getUpdateComplete(){return this._$ES}shouldUpdate(s){return!0}update(s){this._$Eq&&=this._$Eq.forEach(e=>this._$ET(e,this[e])),this._$EM()}updated(s){}firstUpdated(s){}};M.elementStyles=[],M.shadowRootOptions={mode:"open"},M[q("elementProperties")]=new Map,M[q("finalized")]=new Map,Ut?.({ReactiveElement:M}),(ne.reactiveElementVersions??=[]).push("2.1.2");/**
 * @license
 * Copyright 2017 Google LLC
 * SPDX-License-Identifier: BSD-3-Clause
 */var we=globalThis,Ve=r=>r,re=we.trustedTypes,qe=re?re.createPolicy("lit-html",{createHTML:r=>r}):void 0,Xe="$lit$",P=`lit$${Math.random().toFixed(9).slice(2)}$`,Ye="?"+P,Dt=`<${Ye}>`,H=document,G=()=>H.createComment(""),Z=r=>r===null||typeof r!="object"&&typeof r!="function",ke=Array.isArray,It=r=>ke(r)||typeof r?.[Symbol.iterator]=="function",ge=`[ 	
\f\r]`,K=/<(?:(!--|\/[^a-zA-Z])|(\/?[a-zA-Z][^>\s]*)|(\/?$))/g,Ke=/-->/g,Ge=/>/g,L=RegExp(`>|${ge}(?:([^\\s"'>=/]+)(${ge}*=${ge}*(?:[^ 	
\f\r"'\`<>=]|("|')|))|$)`,"g"),Ze=/'/g,Je=/"/g,et=/^(?:script|style|textarea|title)$/i,Se=r=>(s,...e)=>({_$litType$:r,strings:s,values:e}),p=Se(1),b=Se(2),Ds=Se(3),z=Symbol.for("lit-noChange"),u=Symbol.for("lit-nothing"),Qe=new WeakMap,R=H.createTreeWalker(H,129);function tt(r,s){if(!ke(r)||!r.hasOwnProperty("raw"))throw Error("invalid template strings array");return qe!==void 0?qe.createHTML(s):s}var Bt=(r,s)=>{let e=r.length-1,t=[],i,n=s===2?"<svg>":s===3?"<math>":"",o=K;for(let a=0;a<e;a++){let l=r[a],c,h,d=-1,m=0;for(;m<l.length&&(o.lastIndex=m,h=o.exec(l),h!==null);)m=o.lastIndex,o===K?h[1]==="!--"?o=Ke:h[1]!==void 0?o=Ge:h[2]!==void 0?(et.test(h[2])&&(i=RegExp("</"+h[2],"g")),o=L):h[3]!==void 0&&(o=L):o===L?h[0]===">"?(o=i??K,d=-1):h[1]===void 0?d=-2:(d=o.lastIndex-h[2].length,c=h[1],o=h[3]===void 0?L:h[3]==='"'?Je:Ze):o===Je||o===Ze?o=L:o===Ke||o===Ge?o=K:(o=L,i=void 0);let f=o===L&&r[a+1].startsWith("/>")?" ":"";n+=o===K?l+Dt:d>=0?(t.push(c),l.slice(0,d)+Xe+l.slice(d)+P+f):l+P+(d===-2?a:f)}return[tt(r,n+(r[e]||"<?>")+(s===2?"</svg>":s===3?"</math>":"")),t]},J=class r{constructor({strings:s,_$litType$:e},t){let i;this.parts=[];let n=0,o=0,a=s.length-1,l=this.parts,[c,h]=Bt(s,e);if(this.el=r.createElement(c,t),R.currentNode=this.el.content,e===2||e===3){let d=this.el.content.firstChild;d.replaceWith(...d.childNodes)}for(;(i=R.nextNode())!==null&&l.length<a;){if(i.nodeType===1){if(i.hasAttributes())for(let d of i.getAttributeNames())if(d.endsWith(Xe)){let m=h[o++],f=i.getAttribute(d).split(P),g=/([.?@])?(.*)/.exec(m);l.push({type:1,index:n,name:g[2],strings:f,ctor:g[1]==="."?ve:g[1]==="?"?$e:g[1]==="@"?ye:D}),i.removeAttribute(d)}else d.startsWith(P)&&(l.push({type:6,index:n}),i.removeAttribute(d));if(et.test(i.tagName)){let d=i.textContent.split(P),m=d.length-1;if(m>0){i.textContent=re?re.emptyScript:"";for(let f=0;f<m;f++)i.append(d[f],G()),R.nextNode(),l.push({type:2,index:++n});i.append(d[m],G())}}}else if(i.nodeType===8)if(i.data===Ye)l.push({type:2,index:n});else{let d=-1;for(;(d=i.data.indexOf(P,d+1))!==-1;)l.push({type:7,index:n}),d+=P.length-1}n++}}static createElement(s,e){let t=H.createElement("template");return t.innerHTML=s,t}};function U(r,s,e=r,t){if(s===z)return s;let i=t!==void 0?e._$Co?.[t]:e._$Cl,n=Z(s)?void 0:s._$litDirective$;return i?.constructor!==n&&(i?._$AO?.(!1),n===void 0?i=void 0:(i=new n(r),i._$AT(r,e,t)),t!==void 0?(e._$Co??=[])[t]=i:e._$Cl=i),i!==void 0&&(s=U(r,i._$AS(r,s.values),i,t)),s}var be=class{constructor(s,e){this._$AV=[],this._$AN=void 0,this._$AD=s,this._$AM=e}get parentNode(){return this._$AM.parentNode}get _$AU(){return this._$AM._$AU}u(s){let{el:{content:e},parts:t}=this._$AD,i=(s?.creationScope??H).importNode(e,!0);R.currentNode=i;let n=R.nextNode(),o=0,a=0,l=t[0];for(;l!==void 0;){if(o===l.index){let c;l.type===2?c=new Q(n,n.nextSibling,this,s):l.type===1?c=new l.ctor(n,l.name,l.strings,this,s):l.type===6&&(c=new xe(n,this,s)),this._$AV.push(c),l=t[++a]}o!==l?.index&&(n=R.nextNode(),o++)}return R.currentNode=H,i}p(s){let e=0;for(let t of this._$AV)t!==void 0&&(t.strings!==void 0?(t._$AI(s,t,e),e+=t.strings.length-2):t._$AI(s[e])),e++}},Q=class r{get _$AU(){return this._$AM?._$AU??this._$Cv}constructor(s,e,t,i){this.type=2,this._$AH=u,this._$AN=void 0,this._$AA=s,this._$AB=e,this._$AM=t,this.options=i,this._$Cv=i?.isConnected??!0}get parentNode(){let s=this._$AA.parentNode,e=this._$AM;return e!==void 0&&s?.nodeType===11&&(s=e.parentNode),s}get startNode(){return this._$AA}get endNode(){return this._$AB}_$AI(s,e=this){s=U(this,s,e),Z(s)?s===u||s==null||s===""?(this._$AH!==u&&this._$AR(),this._$AH=u):s!==this._$AH&&s!==z&&this._(s):s._$litType$!==void 0?this.$(s):s.nodeType!==void 0?this.T(s):It(s)?this.k(s):this._(s)}O(s){return this._$AA.parentNode.insertBefore(s,this._$AB)}T(s){this._$AH!==s&&(this._$AR(),this._$AH=this.O(s))}_(s){this._$AH!==u&&Z(this._$AH)?this._$AA.nextSibling.data=s:this.T(H.createTextNode(s)),this._$AH=s}$(s){let{values:e,_$litType$:t}=s,i=typeof t=="number"?this._$AC(s):(t.el===void 0&&(t.el=J.createElement(tt(t.h,t.h[0]),this.options)),t);if(this._$AH?._$AD===i)this._$AH.p(e);else{let n=new be(i,this),o=n.u(this.options);n.p(e),this.T(o),this._$AH=n}}_$AC(s){let e=Qe.get(s.strings);return e===void 0&&Qe.set(s.strings,e=new J(s)),e}k(s){ke(this._$AH)||(this._$AH=[],this._$AR());let e=this._$AH,t,i=0;for(let n of s)i===e.length?e.push(t=new r(this.O(G()),this.O(G()),this,this.options)):t=e[i],t._$AI(n),i++;i<e.length&&(this._$AR(t&&t._$AB.nextSibling,i),e.length=i)}_$AR(s=this._$AA.nextSibling,e){for(this._$AP?.(!1,!0,e);s!==this._$AB;){let t=Ve(s).nextSibling;Ve(s).remove(),s=t}}setConnected(s){this._$AM===void 0&&(this._$Cv=s,this._$AP?.(s))}},D=class{get tagName(){return this.element.tagName}get _$AU(){return this._$AM._$AU}constructor(s,e,t,i,n){this.type=1,this._$AH=u,this._$AN=void 0,this.element=s,this.name=e,this._$AM=i,this.options=n,t.length>2||t[0]!==""||t[1]!==""?(this._$AH=Array(t.length-1).fill(new String),this.strings=t):this._$AH=u}_$AI(s,e=this,t,i){let n=this.strings,o=!1;if(n===void 0)s=U(this,s,e,0),o=!Z(s)||s!==this._$AH&&s!==z,o&&(this._$AH=s);else{let a=s,l,c;for(s=n[0],l=0;l<n.length-1;l++)c=U(this,a[t+l],e,l),c===z&&(c=this._$AH[l]),o||=!Z(c)||c!==this._$AH[l],c===u?s=u:s!==u&&(s+=(c??"")+n[l+1]),this._$AH[l]=c}o&&!i&&this.j(s)}j(s){s===u?this.element.removeAttribute(this.name):this.element.setAttribute(this.name,s??"")}},ve=class extends D{constructor(){super(...arguments),this.type=3}j(s){this.element[this.name]=s===u?void 0:s}},$e=class extends D{constructor(){super(...arguments),this.type=4}j(s){this.element.toggleAttribute(this.name,!!s&&s!==u)}},ye=class extends D{constructor(s,e,t,i,n){super(s,e,t,i,n),this.type=5}_$AI(s,e=this){if((s=U(this,s,e,0)??u)===z)return;let t=this._$AH,i=s===u&&t!==u||s.capture!==t.capture||s.once!==t.once||s.passive!==t.passive,n=s!==u&&(t===u||i);i&&this.element.removeEventListener(this.name,this,t),n&&this.element.addEventListener(this.name,this,s),this._$AH=s}handleEvent(s){typeof this._$AH=="function"?this._$AH.call(this.options?.host??this.element,s):this._$AH.handleEvent(s)}},xe=class{constructor(s,e,t){this.element=s,this.type=6,this._$AN=void 0,this._$AM=e,this.options=t}get _$AU(){return this._$AM._$AU}_$AI(s){U(this,s)}};var Wt=we.litHtmlPolyfillSupport;Wt?.(J,Q),(we.litHtmlVersions??=[]).push("3.3.3");var st=(r,s,e)=>{let t=e?.renderBefore??s,i=t._$litPart$;if(i===void 0){let n=e?.renderBefore??null;t._$litPart$=i=new Q(s.insertBefore(G(),n),n,void 0,e??{})}return i._$AI(r),i};/**
 * @license
 * Copyright 2017 Google LLC
 * SPDX-License-Identifier: BSD-3-Clause
 */var Ee=globalThis,C=class extends M{constructor(){super(...arguments),this.renderOptions={host:this},this._$Do=void 0}createRenderRoot(){let s=super.createRenderRoot();return this.renderOptions.renderBefore??=s.firstChild,s}update(s){let e=this.render();this.hasUpdated||(this.renderOptions.isConnected=this.isConnected),super.update(s),this._$Do=st(e,this.renderRoot,this.renderOptions)}connectedCallback(){super.connectedCallback(),this._$Do?.setConnected(!0)}disconnectedCallback(){super.disconnectedCallback(),this._$Do?.setConnected(!1)}render(){return z}};C._$litElement$=!0,C.finalized=!0,Ee.litElementHydrateSupport?.({LitElement:C});var Ft=Ee.litElementPolyfillSupport;Ft?.({LitElement:C});(Ee.litElementVersions??=[]).push("4.2.2");/**
 * @license
 * Copyright 2022 Google LLC
 * SPDX-License-Identifier: BSD-3-Clause
 */var S=class extends C{constructor(){super(...arguments);this.follow=()=>this.requestUpdate()}static{this.properties={bench:{attribute:!1}}}connectedCallback(){super.connectedCallback(),this.bench.addEventListener("change",this.follow)}disconnectedCallback(){super.disconnectedCallback(),this.bench.removeEventListener("change",this.follow)}};function I(r,s){customElements.get(r)||customElements.define(r,s)}var O=k`
  :host {
    font: 400 13px/1.4 system-ui, -apple-system, "Segoe UI", Roboto, "Noto Sans", sans-serif;
    font-variant-numeric: tabular-nums;
    color: var(--ink);
    box-sizing: border-box;
  }
  *, *::before, *::after { box-sizing: border-box; }
  button, select, input, textarea, summary, .button {
    font: inherit;
    font-variant-numeric: tabular-nums;
    color: inherit;
  }
  button, select, summary, .button {
    height: 28px;
    padding: 0 9px;
    border: 1px solid transparent;
    border-radius: 6px;
    background: transparent;
    cursor: pointer;
    white-space: nowrap;
    display: inline-flex;
    align-items: center;
    justify-content: center;
    gap: 6px;
    list-style: none;
  }
  summary::-webkit-details-marker { display: none; }
  select { appearance: none; padding-right: 22px; background: var(--arrow) no-repeat right 8px center; }
  button:hover:not(:disabled), select:hover, summary:hover, .button:hover { background-color: var(--hover); }
  button:disabled { color: var(--faint); cursor: default; }
  button[aria-pressed="true"], button[aria-selected="true"] { background: var(--chosen); color: var(--accent); }
  .icon { padding: 0; width: 28px; }
  svg.sign { width: 16px; height: 16px; fill: none; stroke: currentColor; stroke-width: 1.5; stroke-linecap: round; stroke-linejoin: round; flex: none; }
  input[type="text"], input[type="number"], textarea, .field select {
    height: 28px;
    min-width: 0;
    padding: 0 8px;
    border: 1px solid var(--line);
    border-radius: 6px;
    background-color: var(--well);
  }
  .field select { padding-right: 22px; }
  textarea { height: auto; padding: 6px 8px; resize: vertical; }
  input:hover, textarea:hover { border-color: var(--edge); }
  input[type="checkbox"] { width: 16px; height: 16px; margin: 0; accent-color: var(--accent); }
  :focus { outline: none; }
  :focus-visible { outline: 2px solid var(--accent); outline-offset: 1px; }
  label.check { display: inline-flex; align-items: center; gap: 7px; height: 28px; cursor: pointer; white-space: nowrap; }
  .quiet { color: var(--quiet); }
  .hidden { position: absolute; width: 1px; height: 1px; overflow: hidden; clip-path: inset(50%); white-space: nowrap; }
`;var jt={nm:1e-9,um:1e-6,µm:1e-6,μm:1e-6,mm:.001,cm:.01,m:1},Vt=/^\s*([-+−]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][-+]?\d+)?)\s*([^\d\s].*?)?\s*$/;function N(r){let s=Vt.exec(r);return s?{number:Number(s[1].replace("−","-").replace(",",".")),unit:s[2]??""}:null}function X(r){if(typeof r=="number")return r;let s=N(String(r)),e=s&&jt[s.unit];return s&&e?s.number*e:NaN}function v(r,s=6){if(!Number.isFinite(r))return r>0?"∞":r<0?"−∞":"–";let e=Number(r.toPrecision(s));return Math.abs(e)>=1e-6||e===0?e.toString():e.toExponential()}function _(r){return`${Number((r*1e3).toFixed(6))+0} mm`}function B(r,s=4){let e=Math.abs(r);return Number.isFinite(r)?e>=1?`${v(r,s)} m`:e>=1e-4||e===0?`${v(r*1e3,s)} mm`:`${v(r*1e6,s)} µm`:"∞"}function T(r,s,e){let t=N(r);if(!t)return r;let i=t.unit||typeof s=="string"&&N(s)?.unit||e;return`${t.number}${i?` ${i}`:""}`}function it(r,s){let e=N(r);if(!e)return null;let t=Math.abs(e.number),i=t===0?.1:10**(Math.floor(Math.log10(t))-1);return`${Number((e.number+s*i).toPrecision(10))}${e.unit?` ${e.unit}`:""}`}function Ae(r){return 10**Math.floor(Math.log10(Math.max(r,1e-9)/500))}var qt={length:"mm",angle:"deg",time:"ms"},Me="drawn cells",nt="picture file …",Kt=[[1,0,1,0,1],[0,1,0,1,0],[1,0,1,0,1],[0,1,0,1,0],[1,0,1,0,1]],rt=33,Gt=500,Zt=["z"],Jt=["name","decentre"];function oe(r,s,e,t){let i=({name:n})=>Zt.includes(n)?-1:Jt.indexOf(n)+1;return[...s].sort((n,o)=>i(n)-i(o)).map(n=>Qt(r,n,e[n.name]??null,[...t,n.name]))}function Qt(r,s,e,t){let i=s.family?r.parts?.families[s.family]:void 0;return i?ts(r,s,i,e,t):s.parameters?es(r,s,s.parameters,e,t):Te(r,s,t,Xt(r,s,e,t))}function Te(r,s,e,t){let i=e.join("-"),n=r.refused?.where?.join("-")===i?r.refused.words:null;return p`<div class="field">
    <label for=${i} title=${s.words}>${s.name.replaceAll("_"," ")}</label>
    ${t}
    ${n?p`<p class="wrong" role="alert">${n}</p>`:u}
  </div>`}function Xt(r,s,e,t){let i=t.join("-"),{takes:n,choices:o}=s;if(n.includes("truth"))return p`<input id=${i} type="checkbox" .checked=${(e??s.default)===!0}
      @change=${a=>r.set(t,a.target.checked)}>`;if(o.length){let a=e??s.default;return p`<select id=${i} @change=${l=>r.set(t,l.target.value)}>
      ${o.map(l=>p`<option value=${l} ?selected=${l===a}>${l}</option>`)}</select>`}return n.includes("array")?ot(r,e,t,i):W(e)||Array.isArray(e)&&e.some(a=>typeof a=="object")?p`<output id=${i} class="quiet">${A(e)}</output>`:Yt(r,s,e,t)}function Yt(r,s,e,t){let i=e??s.default,n=s.needed?"":s.default===null||s.default===""?"none":A(s.default),o=s.takes.some(h=>h==="number"||h==="whole number"),a=0,l=h=>{let d=h.target;delete d.dataset.edited,window.clearTimeout(a);let m=d.value.trim()===""?null:_e(s,d.value,i);A(m)!==A(e)?r.set(t,m):d.value=A(e)},c=h=>{let d=h.target;h.key==="Escape"&&(d.value=A(e),delete d.dataset.edited,r.forgive());let m={ArrowUp:1,ArrowDown:-1}[h.key];if(!m||!o)return;let f=d.value||A(s.default),x=s.takes.includes("whole number")&&!s.takes.includes("number")?String(Number(f)+m):it(f,m*(h.shiftKey?10:h.altKey?.1:1));if(x===null)return;h.preventDefault(),d.value=x;let w=_e(s,x,i);r.set(t,w,!0),window.clearTimeout(a),a=window.setTimeout(()=>r.set(t,w),Gt)};return p`<input id=${t.join("-")} type="text" inputmode=${s.takes.includes("text")?"text":"decimal"} autocomplete="off" spellcheck="false"
    .value=${A(e)} placeholder=${n} @input=${h=>h.target.dataset.edited=""}
    @change=${l} @keydown=${c}>`}function es(r,s,e,t,i){let n=i.join("-");return p`${Te(r,s,i,p`<input id=${n} type="checkbox" .checked=${W(t)} ?disabled=${s.needed&&W(t)}
      @change=${o=>r.set(i,o.target.checked?{}:null)}>`)}
    ${W(t)?p`<div class="inner">${oe(r,e,t,i)}</div>`:u}`}function ts(r,s,e,t,i){let n=i.join("-"),o=W(t)?t:null,a=at(t),l=s.family==="pattern"&&s.takes.includes("array"),c=o?String(o.name??""):a?Me:typeof t=="string"?t:Array.isArray(t)?`${t.length} together`:"",h=e.find(f=>f.kind===c),d=[...e.map(f=>f.kind),...l?[Me,nt]:[]];return p`${Te(r,s,i,p`
      <select id=${n} @change=${f=>{let g=f.target,x=g.value;x===nt?(g.nextElementSibling.click(),g.value=c):x===Me?r.set(i,Kt):r.set(i,x===""?null:{name:x})}}>
        ${s.needed?u:p`<option value="" ?selected=${c===""}>none</option>`}
        ${c&&!d.includes(c)?p`<option value=${c} selected>${c}</option>`:u}
        ${d.map(f=>p`<option value=${f} ?selected=${f===c}>${f.replaceAll("_"," ")}</option>`)}
      </select>
      ${l?p`<input type="file" hidden accept="image/*,.npy,.csv,.tif,.exr" aria-label="Picture for the pattern" @change=${f=>{ss(r,i,f.target)}}>`:u}`)}
    ${a?p`<div class="field"><label for="${n}-cells">cells</label>${ot(r,t,i,`${n}-cells`)}</div>`:u}
    ${h&&o?p`<div class="inner">${oe(r,h.parameters,o,i)}</div>`:u}`}async function ss(r,s,e){let t=e.files?.[0];t&&r.act({do:"upload",where:s,name:t.name},[await t.arrayBuffer()]),e.value=""}function ot(r,s,e,t){let i=at(s)?s:null,n=i?.[0]?.length??0;if(!i||i.length>rt||n>rt)return p`<output id=${t} class="quiet">${i?`${i.length} × ${n} numbers`:A(s)||"none"}</output>`;let o=(c,h)=>r.set(e,i.map((d,m)=>m===c?d.map((f,g)=>g===h?f>.5?0:1:f):d)),a=Math.max(5,Math.min(18,Math.floor(180/n))),l=c=>{let h=c.target.value.trim().split(`
`);r.set(e,h.map(d=>d.trim().split(/[\s,]+/).map(m=>Number.isFinite(Number(m))?Number(m):m)))};return p`<div class="cells">
    ${e.includes("pattern")?p`<div class="grid" aria-hidden="true" style="grid-template-columns: repeat(${n}, ${a}px)">
      ${i.map((c,h)=>c.map((d,m)=>p`<i style="height:${a}px;background:color-mix(in srgb, #fff ${100*Math.min(Math.max(d,0),1)}%, #000)" @click=${()=>o(h,m)}></i>`))}
    </div>`:u}
    <textarea id=${t} rows=${Math.min(i.length,6)} spellcheck="false" .value=${i.map(c=>c.join(" ")).join(`
`)} @change=${l}></textarea>
  </div>`}function W(r){return typeof r=="object"&&r!==null&&!Array.isArray(r)}function at(r){return Array.isArray(r)&&r.length>0&&r.every(s=>Array.isArray(s)&&s.every(e=>typeof e=="number"))}function A(r){return r==null?"":Array.isArray(r)?r.map(A).join(", "):W(r)?JSON.stringify(r):String(r)}function _e(r,s,e){let{takes:t,unit:i}=r;if(t.includes("list")&&s.includes(","))return s.split(",").map((l,c)=>_e({...r,takes:["number"]},l,Array.isArray(e)?e[c]??null:e));let n=s.trim();if(i)return T(n,Array.isArray(e)?e[0]??null:e,qt[i]);let o=Number(n.replace("−","-"));return t.some(l=>l!=="text"&&l!=="name")&&n!==""&&Number.isFinite(o)?o:n}var is={undo:"M6.5 3.5 3 7l3.5 3.5M3.5 7H10a3 3 0 0 1 0 6H8",redo:"M9.5 3.5 13 7l-3.5 3.5M12.5 7H6a3 3 0 0 0 0 6h2",plus:"M8 3.5v9M3.5 8h9",minus:"M3.5 8h9",whole:"M3 6V3h3M10 3h3v3M13 10v3h-3M6 13H3v-3",earlier:"M10 3.5 5.5 8l4.5 4.5",later:"M6 3.5 10.5 8 6 12.5",twice:"M5.5 5.5h7v7h-7zM10.5 3.5h-7v7",away:"M3.5 5h9M6.5 5V3.5h3V5M5 5l.5 8h5l.5-8",down:"M4 6.5 8 10.5 12 6.5",aim:"M8 1.5v4M8 10.5v4M1.5 8h4M10.5 8h4",pin:"M6 2.5h4l-.5 5 2 2h-7l2-2zM8 9.5v4.5"};function $(r){return p`<svg class="sign" viewBox="0 0 16 16" aria-hidden="true">${b`<path d=${is[r]}></path>`}</svg>`}var ae=class extends S{typePlace(){let s=this.renderRoot.querySelector('input[id$="-z"]');s?.focus(),s?.select()}updated(){let s=this.renderRoot.querySelector(".chips"),e=s?.querySelector('[aria-selected="true"]');if(!s||!e)return;let t=e.offsetLeft-s.offsetLeft;t<s.scrollLeft?s.scrollLeft=t-8:t+e.offsetWidth>s.scrollLeft+s.clientWidth&&(s.scrollLeft=t+e.offsetWidth-s.clientWidth)}get order(){let s=this.bench.side;return this.bench.elements.map((e,t)=>t).sort((e,t)=>(s?.elements[e]?.z??0)-(s?.elements[t]?.z??0)||e-t)}labelOf(s){if(s==="light field")return"light field";let e=this.bench.partOf(s);return e?e.label[0]??"":s==="sensor"?"sensor":String(this.bench.elements[s]?.kind??"")}render(){let{bench:s}=this;if(!s.document||!s.parts)return u;let e=["light field",...this.order,"sensor"];return p`
      <div class="chips" role="tablist" aria-label="What stands on the bench" @keydown=${this.key}>
        ${e.map(t=>p`<button role="tab" id="tab-${t}" aria-selected=${s.selected===t} aria-controls="form"
          tabindex=${s.selected===t?0:-1} @click=${()=>s.select(t)}>${this.labelOf(t)}${s.notesOf(t).length?p`<i class="note" title="has a note"></i>`:u}</button>`)}
      </div>
      <div class="adds"><select aria-label="Add an element" @change=${this.add}>
        <option value="" selected>+ Add …</option>
        ${s.parts.kinds.map(t=>p`<option value=${t.kind} title=${t.words}>${t.kind.replaceAll("_"," ")}</option>`)}</select></div>
      <div id="form" class="form" role="tabpanel" aria-labelledby="tab-${s.selected}">${this.form()}</div>`}form(){let{selected:s}=this.bench;if(s==="light field")return this.lightField();let e=s==="sensor"?this.bench.document.camera.sensor:this.bench.elements[s],t=s==="sensor"?null:this.kindOf(s),i=s==="sensor"?this.bench.parts.sensor:t?.parameters;return!e||!i?u:p`
      <div class="head"><span class="quiet" title=${t?.words??""}>${[String(e.kind??"").replaceAll("_"," "),...this.bench.partOf(s)?.label.slice(1)??[]].filter(Boolean).join(", ")}</span>${s==="sensor"?u:this.verbs(s)}</div>
      ${this.bench.notesOf(s).map(n=>p`<p class="advice">${n.words}</p>`)}
      ${oe(this.bench,i,e,this.bench.whereOf(s))}`}kindOf(s){return this.bench.parts.kinds.find(e=>e.kind===this.bench.elements[s]?.kind)}verbs(s){let e=this.order.indexOf(s),{bench:t}=this;return p`<span class="verbs">
      <button class="icon" title="One place towards the scene" aria-label="Move before the one before it" ?disabled=${e===0} @click=${()=>t.act({do:"reorder",element:s,by:-1})}>${$("earlier")}</button>
      <button class="icon" title="One place towards the sensor" aria-label="Move behind the one behind it" ?disabled=${e===this.order.length-1} @click=${()=>t.act({do:"reorder",element:s,by:1})}>${$("later")}</button>
      <button class="icon" title="Duplicate" aria-label="Duplicate" @click=${()=>t.duplicate(s)}>${$("twice")}</button>
      <button class="icon" title="Remove" aria-label="Remove" @click=${()=>t.act({do:"remove",element:s})}>${$("away")}</button>
    </span>`}lightField(){let{bench:s}=this,e=s.document;return p`
      <div class="field"><label for="light-field">light field</label>
        <select id="light-field" @change=${t=>s.set(["light_field"],t.target.value)}>
          ${s.parts.light_fields.map(t=>p`<option value=${t} ?selected=${t===e.light_field}>${t}</option>`)}</select></div>
      ${s.views?[0,1].map(t=>this.viewRange(t,s.views)):u}
      ${e.views?p`<div class="field"><span></span><button @click=${()=>s.set(["views"],null)}>All views</button></div>`:u}`}viewRange(s,e){let t={rows:[0,e[0]-1],columns:[0,e[1]-1]},i=this.bench.document.views??t,n=s===0?"rows":"columns",o=(l,c)=>{let h=[...i[n]];h[l]=Math.min(Math.max(Math.round(Number(c)||0),0),e[s]-1),h[0]>h[1]&&(h[1-l]=h[l]),this.bench.set(["views"],{...i,[n]:h})},a=l=>p`<input type="number" min="0" max=${e[s]-1} aria-label="${l?"last":"first"} of the ${n} of views"
      .value=${String(i[n][l])} @change=${c=>o(l,c.target.value)}>`;return p`<div class="field"><span>${n} of views</span><span class="range">${a(0)}<span class="quiet">to</span>${a(1)}<span class="quiet">of ${e[s]}</span></span></div>`}add(s){let e=s.target,t=e.value;if(e.value="",!t)return;let i=this.bench.side,n=[0,...i?.elements.map(c=>c.z)??[],i?.sensor.z??0].sort((c,h)=>c-h),[o,a]=[n[0],n[n.length-1]],l=-1;for(let c=1;c<n.length;c++)n[c]-n[c-1]>l&&([o,a,l]=[n[c-1],n[c],n[c]-n[c-1]]);this.bench.add(t,_(Math.round((o+a)*5e3)/1e4))}key(s){let e={ArrowRight:1,ArrowLeft:-1}[s.key];if(!e)return;let t=["light field",...this.order,"sensor"],i=t[(t.indexOf(this.bench.selected)+e+t.length)%t.length];this.bench.select(i),this.updateComplete.then(()=>this.renderRoot.querySelector(`[id="tab-${i}"]`)?.focus()),s.preventDefault()}static{this.styles=[O,k`
      :host { display: grid; grid-template-columns: 1fr auto; grid-template-rows: auto 1fr; min-height: 0; }
      .chips { display: flex; gap: 2px; overflow-x: auto; padding: 6px 0 6px 8px; scrollbar-width: none; }
      .chips button { height: 26px; position: relative; }
      .note { width: 7px; height: 7px; border-radius: 50%; background: var(--warn); }
      .adds { padding: 6px 8px 6px 4px; }
      .adds select { height: 26px; width: 92px; }
      .form { grid-column: 1 / -1; overflow-y: auto; padding: 0 12px 12px; min-height: 0; }
      .head { display: flex; align-items: center; justify-content: space-between; gap: 8px; min-height: 30px; margin-bottom: 4px; }
      .verbs { display: flex; }
      .field { display: grid; grid-template-columns: minmax(86px, 132px) minmax(0, 1fr); align-items: center; gap: 4px 10px; min-height: 34px; }
      .field > label, .field > span:first-child { color: var(--quiet); overflow-wrap: anywhere; line-height: 1.2; }
      .field > input[type="text"], .field > select { width: 100%; max-width: 260px; }
      .field > button { justify-self: start; border-color: var(--line); }
      .field output { overflow-wrap: anywhere; }
      .field:has(.cells) { align-items: start; }
      .field:has(.cells) > label { padding-top: 6px; }
      .range { display: flex; align-items: center; gap: 6px; }
      .range input { width: 56px; }
      .inner { margin-left: 6px; padding-left: 10px; border-left: 2px solid var(--line); }
      .wrong { grid-column: 2; margin: 0 0 4px; color: var(--error); font-size: 12px; }
      .advice { margin: 0 0 8px; padding: 7px 10px; border-radius: 6px; background: var(--warn-ground); font-size: 12.5px; white-space: pre-line; }
      .cells { display: grid; gap: 6px; max-width: 260px; padding: 4px 0; }
      .grid { display: grid; gap: 1px; justify-content: start; border: 1px solid var(--line); background: var(--line); width: max-content; }
      .grid i { cursor: pointer; }
    `]}};var ns=[["alone","Picture"],["beside","Side by side"],["wipe","Wipe"],["difference","Difference ×4"]],rs=64,os=.0016,as=.005,ls=6,le=class extends S{constructor(){super();this.middle={x:.5,y:.5};this.pointers=new Map;this.gesture=null;this.travelled=0;this.asked=null;this.scratch=document.createElement("canvas");this.watch=new ResizeObserver(([e])=>{this.width=e.contentRect.width,this.height=e.contentRect.height});this.zoom=1,this.compare="alone",this.wipe=.5,this.aiming=!1,this.at=null,this.width=this.height=0}static{this.properties={...S.properties,zoom:{state:!0},compare:{state:!0},wipe:{state:!0},aiming:{state:!0},at:{state:!0},width:{state:!0},height:{state:!0}}}firstUpdated(){this.watch.observe(this.renderRoot.querySelector(".stage")),this.canvas.addEventListener("wheel",e=>this.wheel(e),{passive:!1})}disconnectedCallback(){super.disconnectedCallback(),this.watch.disconnect()}get canvas(){return this.renderRoot.querySelector("canvas")}get shape(){let e=this.bench.document?.camera.sensor.shape;return Array.isArray(e)?[Number(e[0]),Number(e[1])]:this.bench.picture?.about.shape??[1,1]}get mode(){return this.bench.pinned?this.compare:"alone"}get paneWidth(){return this.mode==="beside"?this.width/2:this.width}get unit(){let[e,t]=this.shape;return this.zoom*Math.min((this.paneWidth-2)/t,(this.height-2)/e)}corner(){let[e,t]=this.shape;return{x:this.paneWidth/2-this.middle.x*t*this.unit,y:this.height/2-this.middle.y*e*this.unit}}pixelAt(e){let[t,i]=this.shape,n=this.corner(),o=Math.floor(((this.mode==="beside"?e.x%this.paneWidth:e.x)-n.x)/this.unit),a=Math.floor((e.y-n.y)/this.unit);return o>=0&&a>=0&&o<i&&a<t?{x:o,y:a}:null}zoomTo(e,t={x:this.paneWidth/2,y:this.height/2}){let[i,n]=this.shape,o=this.unit/this.zoom,a=Math.min(Math.max(e,1),Math.max(rs/o,1)),l=this.unit;this.zoom=a;let c=this.unit,h={x:t.x-this.paneWidth/2,y:t.y-this.height/2};this.middle={x:this.middle.x+(h.x/l-h.x/c)/n,y:this.middle.y+(h.y/l-h.y/c)/i},this.keepWithin()}pan(e,t){let[i,n]=this.shape;this.middle={x:this.middle.x-e/this.unit/n,y:this.middle.y-t/this.unit/i},this.keepWithin()}keepWithin(){let[e,t]=this.shape,i=(n,o,a)=>a<=o?.5:Math.min(Math.max(n,o/2/a),1-o/2/a);this.middle={x:i(this.middle.x,this.paneWidth,t*this.unit),y:i(this.middle.y,this.height,e*this.unit)},this.requestUpdate()}wheel(e){e.preventDefault();let t=this.placeOf(e);this.zoomTo(this.zoom*Math.exp(-e.deltaY*os*(e.deltaMode===1?20:1)),{x:t.x%this.paneWidth,y:t.y})}placeOf(e){let t=this.canvas.getBoundingClientRect();return{x:e.clientX-t.left,y:e.clientY-t.top}}down(e){if(e.button!==0)return;let t=this.placeOf(e);this.canvas.setPointerCapture(e.pointerId),this.pointers.set(e.pointerId,t),this.travelled=0,this.gesture=this.onWipe(t)?"wipe":"pan"}onWipe(e){return this.mode==="wipe"&&Math.abs(e.x-this.wipe*this.width)<14}move(e){let t=this.placeOf(e),i=this.pointers.get(e.pointerId);if(!i){this.point(this.pixelAt(t)),this.canvas.classList.toggle("wiping",this.onWipe(t));return}if(this.travelled+=Math.hypot(t.x-i.x,t.y-i.y),this.gesture==="wipe")this.wipe=Math.min(Math.max(t.x/this.width,0),1);else if(this.pointers.size===2){let n=[...this.pointers].find(([a])=>a!==e.pointerId)[1],o=a=>Math.max(Math.hypot(a.x-n.x,a.y-n.y),1);this.zoomTo(this.zoom*o(t)/o(i),{x:(t.x+n.x)/2%this.paneWidth,y:(t.y+n.y)/2})}else this.pan(t.x-i.x,t.y-i.y);this.pointers.set(e.pointerId,t)}up(e){if(!this.pointers.delete(e.pointerId)||this.travelled>4||this.gesture==="wipe")return;let i=this.pixelAt(this.placeOf(e));this.point(i),i&&this.aiming&&this.focusOn(i)}inPicture({x:e,y:t}){let[i,n]=this.shape,[o,a]=this.bench.picture?.about.shape??[i,n];return{x:Math.floor((e+.5)*a/n),y:Math.floor((t+.5)*o/i)}}focusOn(e){this.bench.act({do:"focus",...this.inPicture(e)})}point(e){e?.x===this.at?.x&&e?.y===this.at?.y||(this.at=e,e&&this.bench.picture&&!this.bench.picture.about.coarse&&this.bench.askValue(e.x,e.y))}key(e){let[t,i]=this.shape,n={ArrowLeft:[-1,0],ArrowRight:[1,0],ArrowUp:[0,-1],ArrowDown:[0,1]}[e.key];if(n&&!e.ctrlKey&&!e.metaKey){let o=e.shiftKey?10:1,a=this.at??{x:Math.floor(i/2),y:Math.floor(t/2)},l=Math.min(Math.max(a.x+n[0]*o,0),i-1),c=Math.min(Math.max(a.y+n[1]*o,0),t-1);this.point({x:l,y:c}),this.zoom>1&&(this.middle={x:(l+.5)/i,y:(c+.5)/t},this.keepWithin())}else if(e.key==="+"||e.key==="=")this.zoomTo(this.zoom*1.5);else if(e.key==="-")this.zoomTo(this.zoom/1.5);else if(e.key==="0")this.zoomTo(1);else if(e.key==="Enter"&&this.at)this.focusOn(this.at);else return;e.preventDefault()}askAgain(){let e=this.bench.picture?.about;e===this.asked||!e||e.coarse||(this.asked=e,this.at&&this.bench.askValue(this.at.x,this.at.y))}updated(){this.askAgain();let{canvas:e}=this,t=window.devicePixelRatio||1,[i,n]=[Math.round(this.width*t),Math.round(this.height*t)];(e.width!==i||e.height!==n)&&([e.width,e.height]=[i,n]);let o=e.getContext("2d");o.setTransform(1,0,0,1,0,0),o.clearRect(0,0,i,n),o.setTransform(t,0,0,t,0,0);let a=this.bench.picture?.bitmap;if(!a||!this.width)return;let l=this.bench.pinned;if(this.mode==="alone"||!l)this.put(o,a,0,this.width);else if(this.mode==="beside")this.put(o,l,0,this.paneWidth-1),this.put(o,a,this.paneWidth,this.paneWidth);else if(this.mode==="wipe"){let c=this.wipe*this.width;this.put(o,l,0,c,0),this.put(o,a,c,this.width-c,0),o.fillStyle="rgb(0 0 0 / 50%)",o.fillRect(c-2,0,4,this.height),o.fillStyle="#fff",o.fillRect(c-1,0,2,this.height),o.beginPath(),o.roundRect(c-4,this.height/2-16,8,32,4),o.fill(),o.strokeStyle="rgb(0 0 0 / 50%)",o.stroke()}else this.put(o,this.difference(a,l),0,this.width);this.at&&(this.unit>=ls||this.matchesFocus())&&this.outline(o,this.at)}matchesFocus(){return this.canvas.matches(":focus-visible")}put(e,t,i,n,o=i){let[a,l]=this.shape,c=this.corner();e.save(),e.beginPath(),e.rect(i,0,n,this.height),e.clip(),e.imageSmoothingEnabled=this.unit<2,e.imageSmoothingQuality="high",e.drawImage(t,o+c.x,c.y,l*this.unit,a*this.unit),e.restore()}difference(e,t){let{scratch:i}=this,[n,o]=this.shape;[i.width,i.height]=[o,n];let a=i.getContext("2d");a.drawImage(e,0,0,o,n),a.globalCompositeOperation="difference",a.drawImage(t,0,0,o,n),a.globalCompositeOperation="lighter";for(let l=0;l<2;l++)a.drawImage(i,0,0);return a.globalCompositeOperation="source-over",i}outline(e,{x:t,y:i}){let n=this.corner(),o=Math.max(this.unit,5),a=(o-this.unit)/2;for(let l of this.mode==="beside"?[0,this.paneWidth]:[0]){let c=[l+n.x+t*this.unit-a,n.y+i*this.unit-a];e.lineWidth=3,e.strokeStyle="rgb(0 0 0 / 60%)",e.strokeRect(...c,o,o),e.lineWidth=1.5,e.strokeStyle="#fff",e.strokeRect(...c,o,o)}}render(){let{bench:e}=this,t=e.picture?.about;return p`
      <div class="bar" role="toolbar" aria-label="Picture">
        <div class="group">
          <button class="icon" title="Smaller (−)" aria-label="Zoom out" ?disabled=${this.zoom<=1} @click=${()=>this.zoomTo(this.zoom/1.5)}>${$("minus")}</button>
          <button class="icon" title="Larger (+)" aria-label="Zoom in" @click=${()=>this.zoomTo(this.zoom*1.5)}>${$("plus")}</button>
          <button class="icon" title="All of it (0)" aria-label="The whole picture" @click=${()=>this.zoomTo(1)}>${$("whole")}</button>
        </div>
        <button aria-pressed=${this.aiming} aria-label="Click to focus" title="Click into the picture to focus there: the sensor moves" @click=${()=>this.aiming=!this.aiming}>${$("aim")}<span class="short">Focus</span><span class="long">Click to focus</span></button>
        ${this.exposure()}
        <label class="check" title="Noise of the sensor's electronics"><input type="checkbox" .checked=${e.document?.noise??!1}
          @change=${i=>e.set(["noise"],i.target.checked)}>Noise</label>
        <span class="spring"></span>
        <button aria-pressed=${e.pinned!==null} ?disabled=${!t} title="Keep this picture to compare others with" @click=${()=>this.pin()}>${$("pin")}${e.pinned?"Unpin":"Pin"}</button>
        ${e.pinned?p`<select aria-label="Compare with the pinned picture" .value=${this.compare}
          @change=${i=>this.compare=i.target.value}>
          ${ns.map(([i,n])=>p`<option value=${i} ?selected=${i===this.compare}>${n}</option>`)}</select>`:u}
      </div>
      <div class="stage">
        <canvas ?data-aiming=${this.aiming} tabindex="0" role="application"
          aria-label="The picture. Arrow keys move over its pixels, Enter focuses on one, plus, minus and 0 zoom."
          @pointerdown=${this.down} @pointermove=${this.move} @pointerup=${this.up} @pointercancel=${this.up}
          @pointerleave=${()=>this.point(null)} @dblclick=${()=>this.zoomTo(this.zoom>1?1:8)}
          @focus=${()=>this.requestUpdate()} @blur=${()=>this.requestUpdate()} @keydown=${this.key}></canvas>
        ${this.bench.without?p`<p class="without">${this.bench.without}</p>`:this.captions()}
        ${this.mode==="wipe"?p`<input type="range" class="wipe" min="0" max="1" step="0.01" aria-label="Place of the wipe" .value=${String(this.wipe)}
          @input=${i=>this.wipe=Number(i.target.value)}>`:u}
      </div>
      <div class="line">${this.reading()}<span class="spring"></span>${this.state()}</div>`}pin(){let e=!this.bench.pinned;this.bench.pin(e),e&&this.compare==="alone"&&(this.compare="wipe")}exposure(){let{bench:e}=this,t=e.document?.exposure??null,i=e.picture?.about.white??0;return p`<div class="group">
      <label class="check" title="Brightness is kept as it is now, so that it does not jump"><input type="checkbox" aria-label="Fix exposure" .checked=${t!==null}
        @change=${n=>e.set(["exposure"],n.target.checked?i:null)}><span class="long">Fix exposure</span><span class="short">Exposure</span></label>
      ${t===null?u:p`
        <button class="icon" aria-label="Darker" title="Darker" @click=${()=>e.set(["exposure"],t*Math.SQRT2)}>${$("minus")}</button>
        <button class="icon" aria-label="Brighter" title="Brighter" @click=${()=>e.set(["exposure"],t/Math.SQRT2)}>${$("plus")}</button>`}
    </div>`}captions(){let e=this.bench.picture?.about.psnr,t=this.bench.picture?.about.same?"the same":e==null?"":`PSNR ${v(e,3)} dB`;return this.mode==="alone"?u:this.mode==="difference"?p`<span class="caption left">difference ×4${t?` · ${t}`:""}</span>`:p`<span class="caption left">pinned</span><span class="caption right">now${t?` · ${t}`:""}</span>`}reading(){let{value:e}=this.bench;if(!this.at)return p`<span>${this.zoom>1?`${v(this.unit,3)} : 1`:"Point at the picture to read a pixel."}</span>`;let t=e&&e.x===this.at.x&&e.y===this.at.y,i=t?e.irradiance.map(o=>v(o,4)).join("  "):"…",n=t&&e.recorded?` · DN ${e.recorded.map(o=>v(o,6)).join("  ")}`:"";return p`<span role="status">column ${this.at.x}, row ${this.at.y} · ${i}${n}</span>`}state(){let e=this.bench.picture?.about;return e?p`
      ${e.missing>as?p`<span class="missing" title="Rays that the light field does not hold: pixels are darker there than they would be">${v(100*e.missing,2)} % of the rays missing</span>`:u}
      <span>${this.shape[1]} × ${this.shape[0]}${e.coarse?", coarse":""} · ${v(e.took,3)} ms</span>`:u}static{this.styles=[O,k`
      :host { display: flex; flex-direction: column; min-height: 0; min-width: 0; container-type: inline-size; }
      .short { display: none; }
      .bar { display: flex; flex-wrap: wrap; align-items: center; gap: 2px 8px; padding: 6px 8px; }
      .group { display: flex; align-items: center; gap: 2px; }
      .spring { flex: 1; }
      .stage { position: relative; flex: 1; min-height: 0; background: var(--stage); overflow: hidden; }
      canvas { position: absolute; inset: 0; width: 100%; height: 100%; touch-action: none; cursor: crosshair; }
      canvas[data-aiming] { cursor: cell; }
      canvas:focus-visible { outline-offset: -2px; }
      .without { position: absolute; left: 10%; right: 10%; top: 40%; margin: 0; padding: 12px 16px; border-radius: 8px; background: var(--error-ground); white-space: pre-line; overflow-wrap: anywhere; }
      .caption { position: absolute; top: 8px; padding: 2px 8px; border-radius: 4px; background: rgb(0 0 0 / 62%); color: #fff; font-size: 12px; pointer-events: none; }
      .caption.left { left: 8px; } .caption.right { right: 8px; }
      /* The line itself is dragged; the slider is there for keys, and seen when they are on it. */
      .wipe { position: absolute; left: 0; right: 0; bottom: 6px; width: 100%; margin: 0; accent-color: var(--accent); pointer-events: none; opacity: 0; }
      .wipe:focus-visible { opacity: 1; }
      canvas.wiping { cursor: ew-resize; }
      .line { display: flex; gap: 14px; min-height: 26px; align-items: center; padding: 0 10px; font-size: 12px; color: var(--quiet); white-space: nowrap; overflow: hidden; }
      .line > span { overflow: hidden; text-overflow: ellipsis; white-space: pre; }
      .line > .missing { color: var(--warn-ink); }
      @container (max-width: 540px) { .short { display: inline; } .long { display: none; } .bar { gap: 2px; padding: 6px 4px; } button { padding: 0 6px; } label.check { gap: 5px; } .icon { width: 26px; padding: 0; } }
    `]}};function ct(r,s,e){let t=e.x(s),i=r.openings?.[0],n=r.half??(r.beam?1.08*r.beam:1/0),[o,a]=i&&r.length===0?[i[1],i[2]]:[r.decentre-n,r.decentre+n],l=Math.min(e.y(o),e.bottom),c=Math.max(e.y(a),e.top),h=r.half!==null,d={lens:cs,block:ds,prism:hs,glass:ps,frosted:us,mask:ms,sheet:lt}[r.drawn]??lt;return b`
    ${d(r,t,l,c,e,h)}
    ${(r.openings??[]).map(m=>fs(t+e.x(m[0])-e.x(r.z),m,r,e))}`}function cs(r,s,e,t,{thick:i},n){let[o,a]=r.converging===!1?[i,.25*i]:[.12*i,i],l=2*a-o,c=(e+t)/2;return b`<path class="glass ${n?"":"open"}" d="M${s-o} ${e} Q${s-l} ${c} ${s-o} ${t}
    H${s+o} Q${s+l} ${c} ${s+o} ${e} Z"></path>`}function hs(r,s,e,t,{thick:i}){let n=r.towards??0,o=n===0?i:.05*i,[a,l]=n>=0?[i,o]:[o,i];return b`<path class="glass open" d="M${s-a} ${t}H${s+a}L${s+l} ${e}H${s-l}Z"></path>`}function ds(r,s,e,t,i,n){let o=Math.max(i.x(r.z+r.length)-i.x(r.z),i.thick);return b`<rect class="glass block ${n?"":"open"}" x=${s} y=${t} width=${o} height=${e-t}></rect>`}function ps(r,s,e,t,i,n){let o=(r.profile??[]).map(([h,d])=>[i.y(h),d]),a=o.map(([h,d])=>`${(s-i.thick*(.4+1.1*d)).toFixed(2)} ${h.toFixed(2)}`),l=o[0]?.[0]??e,c=o[o.length-1]?.[0]??t;return b`<path class="glass ${n?"":"open"}" d="M${s} ${l} L${a.join("L")} L${s} ${c} Z"></path>
    ${Pe(r,s-.4*i.thick,s,i,!0)}`}function us(r,s,e,t,i,n){let o=.5*i.thick,a=(r.roughness??[]).map(([d,m])=>[i.y(d),m]),l=d=>a.reduce((m,f)=>Math.abs(f[0]-d)<Math.abs(m[0]-d)?f:m,a[0]??[0,1])[1],c=[],h=7;for(let d=t;d<e;d+=3){h=h*16807%2147483647;let m=i.thick*(.1+.9*l(d))*(.4+.6*h/2147483647);c.push(`${s} ${d.toFixed(1)}L${(s+m).toFixed(2)} ${Math.min(d+1.5,e).toFixed(1)}`)}return b`<path class="frost ${n?"":"open"}" d="M${s-o} ${t}L${c.join("L")}L${s} ${e}H${s-o}Z"></path>
    ${Pe(r,s-o,s,i,!0)}`}function ms(r,s,e,t,i,n){let o=Math.max(.35*i.thick,2);return b`${Pe(r,s-o,s+o,i,!1)}
    ${n?b`<rect class="outline" x=${s-o} y=${t} width=${2*o} height=${Math.max(e-t,0)}></rect>`:u}`}function Pe(r,s,e,t,i){return(r.shades??[]).map(([n,o,a])=>{let l=Math.max(t.y(o),t.top),c=Math.min(t.y(n),t.bottom);return c<=l||i&&a===1?u:b`<rect class="dark" x=${s} y=${l} width=${e-s} height=${c-l} fill-opacity=${1-a}></rect>`})}function lt(r,s,e,t){return b`<path class="sheet" d="M${s} ${t}V${e}"></path>`}function fs(r,[,s,e],t,i){let[n,o]=[Math.min(i.y(s),i.bottom),Math.max(i.y(e),i.top)],a=.05*(i.bottom-i.top),l=t.drawn==="block"&&t.half!==null?1.08*Math.max(t.half,t.beam??0):1/0,c=Math.max(i.y(t.decentre+l),i.top),h=Math.min(i.y(t.decentre-l),i.bottom);return b`
    <path class="rim heavy" d="M${r} ${o}V${Math.max(o-a,c)}M${r} ${n}V${Math.min(n+a,h)}"></path>
    <path class="rim" d="M${r} ${o}V${c}M${r} ${n}V${h}"></path>`}function ht(r,s,e){let t=e.x(s),i=Math.max(e.y(r.decentre+r.half),e.top),n=Math.min(e.y(r.decentre-r.half),e.bottom);return b`<rect class="sensor" x=${t} y=${i} width=${1.1*e.thick} height=${Math.max(n-i,1)} rx="1"></rect>`}var E={left:14,right:30,top:46,bottom:40},gs=7,bs=60,dt=18,pt=1.35,vs=.06,$s=500,ys=500,ut=document.createElement("canvas").getContext("2d");function mt(r,s=!1){return ut.font=`${s?600:400} 11.5px system-ui, -apple-system, "Segoe UI", Roboto, "Noto Sans", sans-serif`,ut.measureText(r).width}function xs({colour:r,words:s}){return r==="off axis"?"off the axis":s.replace(/ away$/,"")}var ce=class extends S{constructor(){super();this.frame=null;this.keyTimer=0;this.watch=new ResizeObserver(([e])=>{this.width=Math.round(e.contentRect.width),this.height=Math.round(e.contentRect.height)});this.width=this.height=0,this.drag=this.hover=null}static{this.properties={...S.properties,width:{state:!0},height:{state:!0},drag:{state:!0},hover:{state:!0}}}connectedCallback(){super.connectedCallback(),this.watch.observe(this)}disconnectedCallback(){super.disconnectedCallback(),this.watch.disconnect()}placeOf(e){return this.drag?.which===e?this.drag.z:(e==="sensor"?this.bench.side?.sensor.z:this.bench.side?.elements[e]?.z)??0}parts(){return[...this.bench.side?.elements.map((t,i)=>i)??[],"sensor"]}framed(e){let t={start:e.from,end:e.to+vs*(e.to-e.from),half:e.half},i=this.frame;return i&&this.drag||i&&t.start>=i.start&&t.end<=i.end&&t.half<=i.half&&(t.end-t.start)*pt>i.end-i.start&&t.half*pt>i.half?i:(this.frame=t,t)}scale(e){let{start:t,end:i,half:n}=this.framed(e),o=(this.width-E.left-E.right)/(i-t),a=(E.top+this.height-E.bottom)/2,l=(this.height-E.top-E.bottom)/2/n;return{x:c=>E.left+(c-t)*o,z:c=>t+(c-E.left)/o,y:c=>a-c*l,top:E.top,bottom:this.height-E.bottom,thick:Math.min(Math.max(.016*(i-t)*o,4),11)}}nearest(e){let t=this.bench.side;if(!t)return null;let i=this.scale(t),n=this.getBoundingClientRect(),o=e.clientX-n.left,a=null,l=e.pointerType==="mouse"?dt:1.6*dt;for(let c of this.parts()){let h=c==="sensor"?0:t.elements[c].length,d=i.x(this.placeOf(c)),m=i.x(this.placeOf(c)+h),f=o<d?d-o:o>m?o-m:0;(f<l||f===l&&c===this.bench.selected)&&([a,l]=[c,f])}return a===null?null:{which:a,x:o}}down(e){let t=this.nearest(e);if(!t||e.button!==0)return;this.bench.select(t.which);let i=this.placeOf(t.which);this.drag={which:t.which,grip:t.x-this.scale(this.bench.side).x(i),from:i,z:i,snaps:this.snapsOf(t.which),snap:null,moved:!1},e.currentTarget.setPointerCapture(e.pointerId),this.renderRoot.querySelector(`[data-part="${t.which}"]`)?.focus({preventScroll:!0,focusVisible:!1}),e.preventDefault()}move(e){if(!this.drag){this.hover=this.nearest(e)?.which??null;return}let t=this.scale(this.bench.side),i=Ae(this.frame.end-this.frame.start)/10,n=e.clientX-this.getBoundingClientRect().left-this.drag.grip,o=Math.round(t.z(n)/i)*i,a=e.altKey?null:this.snapNear(this.drag.snaps,n,t);a&&Math.abs(t.x(a.z)-n)<gs&&(o=a.z),!(o===this.drag.z&&this.drag.moved)&&(!this.drag.moved&&Math.abs(t.x(o)-t.x(this.drag.from))<2||(this.drag={...this.drag,z:o,snap:a,moved:!0},this.bench.set([...this.bench.whereOf(this.drag.which),"z"],_(o),!0)))}up(){let e=this.drag;if(!e)return;e.moved&&this.bench.set([...this.bench.whereOf(e.which),"z"],_(e.z));let t=()=>Math.abs((this.bench.partOf(e.which)?.z??NaN)-e.z)<1e-9,i=()=>{this.bench.removeEventListener("change",n),this.drag===e&&(this.drag=null)},n=()=>{t()&&i()};this.bench.addEventListener("change",n),!e.moved||t()?i():window.setTimeout(i,400)}snapsOf(e){return(e==="sensor"?this.bench.side?.snaps:this.bench.side?.elements[e]?.snaps)??[]}snapNear(e,t,i){let n=null;for(let o of e)Math.abs(i.x(o.z)-t)<bs&&(!n||Math.abs(i.x(o.z)-t)<Math.abs(i.x(n.z)-t))&&(n=o);return n}key(e,t){let i={ArrowRight:1,ArrowUp:1,ArrowLeft:-1,ArrowDown:-1}[e.key];if(i&&!e.ctrlKey&&!e.metaKey){e.preventDefault();let n=Ae(this.frame.end-this.frame.start)*(e.shiftKey?10:e.altKey?.1:1),o=(this.drag?.which===t?this.drag.z:this.placeOf(t))+i*n,a=this.drag?.from??this.placeOf(t);this.drag={which:t,grip:0,from:a,z:Math.round(o/(n/10))*(n/10),snaps:[],snap:null,moved:!0},this.bench.set([...this.bench.whereOf(t),"z"],_(this.drag.z),!0),window.clearTimeout(this.keyTimer),this.keyTimer=window.setTimeout(()=>this.keysDone(),ys)}else if(e.key==="Enter")this.dispatchEvent(new CustomEvent("type-place",{bubbles:!0,composed:!0})),e.preventDefault();else if((e.key==="Delete"||e.key==="Backspace")&&t!=="sensor")this.bench.act({do:"remove",element:t}),e.preventDefault();else if(e.key==="Escape"&&this.drag){let{from:n}=this.drag;this.drag={...this.drag,z:n},this.keysDone()}}keysDone(){window.clearTimeout(this.keyTimer),this.drag&&this.up()}render(){let e=this.bench.side;if(!e||!this.width||!this.height)return u;let t=this.scale(e),i=this.drag||this.hover!==null?"grab":"";return p`
      <svg width=${this.width} height=${this.height} class=${i} role="group" aria-label="The camera from the side"
        @pointerdown=${this.down} @pointermove=${this.move} @pointerup=${this.up} @pointercancel=${this.up}
        @pointerleave=${()=>this.hover=null}>
        <path class="axis" d="M0 ${t.y(0)}H${this.width}"></path>
        ${this.parts().map(n=>this.drawBack(n,e,t))}
        ${this.parts().map(n=>this.drawPart(n,e,t))}
        <g class="rays">${e.rays.map(n=>this.drawRays(n,t))}</g>
        ${this.drawSnap(t)}
        ${this.drawLabels(e,t)}
        ${this.drawDistances(e,t)}
      </svg>
      <ul class="legend">
        ${e.rays.filter(n=>this.width>$s||n.colour!=="off axis").map(n=>p`<li><i class="ray ${n.colour.replace(" ","-")}"></i>${xs(n)}</li>`)}
      </ul>`}drawRays(e,t){let i=new Map,n=[],o=Math.max(...e.paths.map(a=>a[a.length-1]?.[0]??-1/0));for(let a of e.paths){for(let h=1;h<a.length;h++){let[[d,m],[f,g,x]]=[a[h-1],a[h]],w=Math.ceil(x*5)/5;i.has(w)||i.set(w,[]),i.get(w).push(`M${t.x(d).toFixed(1)} ${t.y(m).toFixed(1)}L${t.x(f).toFixed(1)} ${t.y(g).toFixed(1)}`)}let[l,c]=a[a.length-1]??[o,0];l<o-1e-9&&n.push([t.x(l),t.y(c)])}return b`<g class="ray ${e.colour.replace(" ","-")}">
      ${[...i].map(([a,l])=>b`<path d=${l.join("")} stroke-opacity=${.25+.6*a}></path>`)}
      ${n.map(([a,l])=>b`<circle cx=${a} cy=${l} r="2"></circle>`)}
    </g>`}drawSnap(e){let t=this.drag?.snap;if(!t)return u;let i=this.drag.z===t.z,n=e.x(t.z),o=n>this.width-110;return b`<g class="snap ${i?"held":""}">
      <path d="M${n} ${e.top-6}V${e.bottom+4}"></path>
      <text x=${n+(o?-16:16)} y=${e.bottom-6} text-anchor=${o?"end":"start"}>${t.words}</text>
    </g>`}strip(e,t,i){let n=this.placeOf(e),o=e==="sensor"?1.1*i.thick:i.x(n+t.elements[e].length)-i.x(n),a=o>0?6:9;return{x:i.x(n)-a,y:i.top-4,width:o+2*a,height:i.bottom-i.top+8}}drawBack(e,t,i){let n=this.bench.selected===e?"selected":this.hover===e?"hover":"";if(!n)return u;let{x:o,y:a,width:l,height:c}=this.strip(e,t,i);return b`<rect class="back ${n}" x=${o} y=${a} width=${l} height=${c} rx="5"></rect>`}drawPart(e,t,i){let n=this.placeOf(e),o=e==="sensor"?t.sensor:t.elements[e],a=(this.frame.end-this.frame.start)*1e3,{x:l,y:c,width:h,height:d}=this.strip(e,t,i);return b`<g class="part" data-part=${e} tabindex="0" role="slider"
        aria-label="${o.label.join(", ")}: place on the axis" aria-orientation="horizontal"
        aria-valuemin=${(this.frame.start*1e3).toFixed(1)} aria-valuemax=${(this.frame.start*1e3+2*a).toFixed(1)}
        aria-valuenow=${(n*1e3).toFixed(3)} aria-valuetext=${B(n,6)}
        @keydown=${m=>this.key(m,e)}
        @focus=${()=>this.bench.select(e)} @blur=${()=>this.keysDone()}>
      <rect class="strip" x=${l} y=${c} width=${h} height=${d} rx="5"></rect>
      ${e==="sensor"?ht(t.sensor,n,i):ct({...t.elements[e],z:n},n,i)}
    </g>`}drawLabels(e,t){let i=this.parts().map(o=>{let a=o==="sensor"?e.sensor:e.elements[o],l=o==="sensor"?0:e.elements[o].length,c=this.placeOf(o),h=this.bench.selected===o,d=a.label[0]??"",m=h?`${d} · ${B(c,6)}`:d;return{which:o,x:t.x(c+l/2),words:m,chosen:h,notes:this.bench.notesOf(o).length}}).sort((o,a)=>o.x-a.x),n=[-1/0,-1/0,-1/0];return i.map(o=>{let a=mt(o.words,o.chosen)/2+5,l=Math.min(Math.max(o.x,a),this.width-a-(o.notes?14:0)),c=n.findIndex(d=>d<l-a);c<0&&(c=n.indexOf(Math.min(...n))),n[c]=l+a+(o.notes?14:0);let h=E.top-11-13*c;return b`<g class="label ${o.chosen?"chosen":""}" aria-hidden="true">
        <text x=${l} y=${h} text-anchor="middle">${o.words}</text>
        ${o.notes?this.drawBadge(o.which,l+a+4,h-4,o.notes):u}
      </g>`})}drawBadge(e,t,i,n){let o=this.bench.notesOf(e).map(a=>a.words).join(`
`);return b`<g class="badge" @pointerdown=${a=>{a.stopPropagation(),this.bench.select(e),this.dispatchEvent(new CustomEvent("show-notes",{bubbles:!0,composed:!0}))}}>
      <circle cx=${t} cy=${i} r="6.5"></circle>
      <text x=${t} y=${i+3.4} text-anchor="middle">${n>1?n:"!"}</text><title>${o}</title></g>`}drawDistances(e,t){let i=[...new Set(this.parts().map(c=>this.placeOf(c)))].sort((c,h)=>c-h),n=this.height-24,o=i.slice(1).map((c,h)=>{let[d,m]=[t.x(i[h]),t.x(c)],f=B(c-i[h],5),g=mt(f)+10;return b`<path d="M${d} ${n}H${m}"></path>
        ${m-d>g+4?b`<rect x=${(d+m-g)/2} y=${n-7} width=${g} height="14"></rect>
        <text x=${(d+m)/2} y=${n+4} text-anchor="middle">${f}</text>`:u}`}),a=i.map(c=>`M${t.x(c)} ${n-4}v8`).join(""),l=e.from<0&&i.length?b`<text class="scene" x="8" y=${n+4}>← scene</text>`:u;return b`<g class="distances" aria-hidden="true">${o}<path d=${a}></path>${l}</g>`}static{this.styles=[O,k`
      :host { display: block; position: relative; overflow: hidden; min-height: 150px; }
      svg { position: absolute; inset: 0; touch-action: pan-y; user-select: none; }
      svg.grab { cursor: ew-resize; }
      text { font-size: 11.5px; fill: var(--quiet); }
      .axis { stroke: var(--edge); stroke-width: 1; stroke-dasharray: 10 3 2 3; fill: none; }
      .rays { pointer-events: none; }
      g.ray path { fill: none; stroke-width: 1.15; stroke-linecap: round; }
      g.ray.focused path { stroke: var(--focused); } g.ray.focused circle { fill: var(--focused); }
      g.ray.near path { stroke: var(--near); } g.ray.near circle { fill: var(--near); }
      g.ray.far path { stroke: var(--far); } g.ray.far circle { fill: var(--far); }
      g.ray.off-axis path { stroke: var(--aside); } g.ray.off-axis circle { fill: var(--aside); }
      .part { outline: none; }
      .back.hover { fill: var(--hover); }
      .back.selected { fill: var(--chosen); }
      .strip { fill: transparent; }
      .part:focus-visible .strip { stroke: var(--accent); stroke-width: 2; }
      .glass { fill: var(--glass); stroke: var(--glass-edge); stroke-width: 1.2; fill-opacity: 0.85; }
      .glass.block { fill-opacity: 0.5; }
      .glass.open { stroke-dasharray: 4 3; }
      .frost { fill: var(--frost); stroke: var(--frost-edge); stroke-width: 0.8; }
      .frost.open { stroke-dasharray: 4 3; }
      .dark { fill: var(--ink); }
      .outline { fill: none; stroke: var(--ink); stroke-width: 0.8; }
      .sheet { stroke: var(--glass-edge); stroke-width: 2; fill: none; }
      .rim { stroke: var(--ink); stroke-width: 1; stroke-opacity: 0.5; fill: none; }
      .rim.heavy { stroke-width: 3; stroke-opacity: 1; }
      .sensor { fill: var(--quiet); stroke: var(--ink); stroke-width: 0.8; }
      .label.chosen text { fill: var(--accent); font-weight: 600; }
      .badge { cursor: pointer; }
      .badge circle { fill: var(--warn); }
      .badge text { fill: var(--on-warn); font-size: 10px; font-weight: 700; }
      .snap path { stroke: var(--focused); stroke-width: 1; stroke-dasharray: 2 4; stroke-opacity: 0.6; }
      .snap text { fill: var(--focused); fill-opacity: 0.75; }
      .snap.held path { stroke-dasharray: none; stroke-width: 1.5; stroke-opacity: 1; }
      .snap.held text { fill-opacity: 1; font-weight: 600; }
      .distances path { stroke: var(--edge); fill: none; }
      .distances rect { fill: var(--ground); }
      .legend { position: absolute; left: 10px; right: 10px; bottom: 0; margin: 0; padding: 0; list-style: none; display: flex; justify-content: center; gap: 0 16px; white-space: nowrap; font-size: 11.5px; line-height: 16px; color: var(--quiet); pointer-events: none; }
      .legend i { display: inline-block; width: 14px; height: 2px; margin-right: 6px; vertical-align: 3px; border-radius: 1px; }
      i.focused { background: var(--focused); } i.near { background: var(--near); } i.far { background: var(--far); } i.off-axis { background: var(--aside); }
    `]}};var bt=[["explain","Explain"],["phase space","Phase space"],["point spread","Point spread"],["mtf","MTF"]],Ce="phase space",Oe=["point spread","mtf"],j=460,F=230,y={left:40,right:12,top:12,bottom:38};function vt({message:r,pictures:s}){switch(r.what){case"explain":return p`<pre>${r.words}</pre>`;case"point spread":return p`<p>${r.words}.</p><img class="point" src=${s[0]??""} alt="Picture of a point ${ft(r.distance)}, ${r.shape[1]} by ${r.shape[0]} pixels">`;case"mtf":return Ss(r.across,r.down,ft(r.distance));case"phase space":return r.frame?ks(r.planes[0],r.frame,s[0]??""):p`<div class="planes">${r.planes.map((e,t)=>ws(e,s[t]??""))}</div>
        <p class="quiet">Each plane: places across it from left to right, slopes of the rays there upwards.</p>`}}function ft(r){return r===null?"infinitely far away":`${B(r,3)} away`}function ws(r,s){let e=r.title;return p`<figure><img src=${s} alt="Phase space: ${e}"><figcaption>${e}<br>
    <span class="quiet">${v(r.place[0]*1e3,3)} to ${v(r.place[1]*1e3,3)} mm · slopes ${v(r.slope[0],2)} to ${v(r.slope[1],2)}</span></figcaption></figure>`}function ks(r,s,e){let t=1.2*F,[i,n,o,a]=[y.left+14,j-y.right,y.top,t-y.bottom],l=d=>i+(d-s.place[0])/(s.place[1]-s.place[0])*(n-i),c=d=>a-(d-s.slope[0])/(s.slope[1]-s.slope[0])*(a-o),h=s.place[1]-s.place[0]<.001?{of:1e6,unit:"µm"}:{of:1e3,unit:"mm"};return p`<figure><svg viewBox="0 0 ${j} ${t}" class="curves" role="img" aria-label="Phase space ${r.title}">
    <rect class="ground" x=${i} y=${o} width=${n-i} height=${a-o}></rect>
    <image href=${e} preserveAspectRatio="none" x=${l(r.place[0])} y=${c(r.slope[1])}
      width=${l(r.place[1])-l(r.place[0])} height=${c(r.slope[0])-c(r.slope[1])}></image>
    ${gt(s.place[0]*h.of,s.place[1]*h.of).map(d=>b`<path class="grid" d="M${l(d/h.of)} ${a}v4"></path>
      <text x=${l(d/h.of)} y=${a+16} text-anchor="middle">${v(d,3)}</text>`)}
    ${gt(...s.slope).map(d=>b`<path class="grid" d="M${i} ${c(d)}h-4"></path>
      <text x=${i-6} y=${c(d)+4} text-anchor="end">${v(d,3)}</text>`)}
    <text x=${(i+n)/2} y=${t-5} text-anchor="middle">place across the plane, ${h.unit}</text>
    <text transform="translate(11 ${(o+a)/2}) rotate(-90)" text-anchor="middle">slope</text></svg>
    <figcaption>${r.title}</figcaption></figure>`}function gt(r,s){let e=10**Math.floor(Math.log10(s-r)),t=[.2,.5,1,2].map(n=>n*e).find(n=>(s-r)/n<=6),i=Math.ceil(r/t-1e-9);return Array.from({length:Math.floor(s/t+1e-9)-i+1},(n,o)=>(i+o)*t)}function Ss(r,s,e){let t=Math.max(r[r.length-1]?.[0]??1,s[s.length-1]?.[0]??1);if(!(t>0))return p`<p>All light of a point ${e} falls into one pixel: its contrast is that of the pixel itself.</p>`;let i=h=>y.left+h/t*(j-y.left-y.right),n=h=>F-y.bottom-h*(F-y.top-y.bottom),o=h=>"M"+h.map(([d,m])=>`${i(d).toFixed(1)} ${n(m).toFixed(1)}`).join("L"),a=10**Math.floor(Math.log10(t)),l=a*(t<2.5*a?.5:t<5*a?1:2),c=Array.from({length:Math.floor(t/l+1e-9)+1},(h,d)=>d*l);return p`<svg viewBox="0 0 ${j} ${F}" class="curves" role="img" aria-label="Contrast over frequency of a point ${e}">
    ${[0,.25,.5,.75,1].map(h=>b`<path class="grid" d="M${y.left} ${n(h)}H${j-y.right}"></path>
      <text x=${y.left-6} y=${n(h)+4} text-anchor="end">${h}</text>`)}
    ${c.map(h=>b`<text x=${i(h)} y=${F-y.bottom+16} text-anchor="middle">${v(h,3)}</text>`)}
    <text x=${(y.left+j-y.right)/2} y=${F-5} text-anchor="middle">cycles per millimetre on the sensor, of a point ${e}</text>
    <path class="across" d=${o(r)}></path><path class="down" d=${o(s)}></path></svg>
    <p class="key"><i class="across"></i>across <i class="down"></i>down${Es(r,s)?p`<span class="quiet"> (the same)</span>`:u}</p>`}function Es(r,s){return r.length===s.length&&r.every(([,e],t)=>Math.abs(e-s[t][1])<.01)}var $t=k`
  .point { width: min(100%, 320px); image-rendering: pixelated; background: #000; }
  .planes { display: grid; grid-template-columns: repeat(auto-fill, minmax(170px, 1fr)); gap: 12px; margin-bottom: 10px; }
  .planes img { width: 100%; aspect-ratio: 4 / 3; object-fit: fill; background: #000; display: block; }
  figure { margin: 0; }
  figcaption { margin-top: 4px; font-size: 12px; line-height: 1.35; }
  .curves { width: 100%; max-width: 620px; display: block; }
  .curves .ground { fill: #000; }
  .curves text { font-size: 11px; fill: var(--quiet); }
  .curves path { fill: none; stroke-width: 1.8; }
  .curves path.grid { stroke: var(--line); stroke-width: 1; }
  .curves .across { stroke: var(--focused); }
  .curves .down { stroke: var(--near); stroke-dasharray: 5 3; }
  .key i { display: inline-block; width: 16px; height: 2px; vertical-align: 3px; margin-right: 5px; }
  .key i.across { background: var(--focused); }
  .key i.down { background: var(--near); margin-left: 14px; }
`;var As=[["toml","Camera file (TOML)"],["python","Python program of this picture"],["png","Picture (PNG)"],["exr","Picture (OpenEXR, linear)"]],Le=class extends S{constructor(){super();this.distance="";this.plane="";this.underway=void 0;this.askNext=!1;this.askedFor="";this.askTimer=0;this.keyOutside=e=>{e.target===document.body&&this.key(e)};this.typePlace=()=>{this.beside="parts",this.updateComplete.then(()=>this.renderRoot.querySelector("vcc-bench-editor")?.typePlace())};this.showNotes=()=>{this.beside="parts"};this.key=e=>{if(!(e.ctrlKey||e.metaKey)||e.altKey)return;let t=e.key.toLowerCase();e.composedPath().some(n=>n instanceof HTMLElement&&n.matches("[data-edited]"))||t!=="z"&&t!=="y"||(e.preventDefault(),e.stopPropagation(),this.bench.act({do:t==="y"||e.shiftKey?"redo":"undo"}))};this.keepAnswer=()=>{if(this.underway!==void 0&&(this.bench.answer!==this.underway||this.bench.refused||!this.bench.open)&&(this.underway=void 0,this.askNext&&this.askAgain()),this.beside==="parts"||this.beside==="notes"||!this.bench.document)return;let e=this.beside+JSON.stringify(this.bench.document);if(e===this.askedFor)return;let t=this.askedFor==="",i=X(this.bench.document.camera.sensor.z);!t&&X(T(this.plane,null,"mm"))>i&&(this.plane=_(i)),this.askedFor=e,window.clearTimeout(this.askTimer),this.askTimer=window.setTimeout(()=>this.askAgain(),t?0:300)};this.beside="parts",this.film=null}static{this.properties={...S.properties,beside:{state:!0},film:{state:!0}}}connectedCallback(){super.connectedCallback(),this.bench.addEventListener("change",this.keepAnswer),this.addEventListener("keydown",this.key),this.bench.options.address&&window.addEventListener("keydown",this.keyOutside),this.addEventListener("type-place",this.typePlace),this.addEventListener("show-notes",this.showNotes)}disconnectedCallback(){super.disconnectedCallback(),this.bench.removeEventListener("change",this.keepAnswer),window.removeEventListener("keydown",this.keyOutside),window.clearTimeout(this.askTimer)}show(e){this.beside=e,this.askedFor="",this.keepAnswer()}askAgain(){if(this.beside==="parts"||this.beside==="notes"||(this.askNext=this.underway!==void 0,this.askNext))return;this.underway=this.bench.answer;let e=this.distance.trim(),t=this.plane.trim();Oe.includes(this.beside)&&e?this.bench.question(this.beside,{distance:T(e,null,"m")}):this.beside===Ce&&t?this.bench.question(this.beside,{z:T(t,null,"mm")}):this.bench.question(this.beside)}showPlane(e){this.plane=e.trim()&&T(e,this.plane,"mm"),this.bench.forgive(),this.askAgain()}planeField(){let e=this.bench.side?.sensor.z??0,t=X(T(this.plane.trim(),null,"mm"));return p`<div class="distance"><label>plane at <input type="text" placeholder="each plane" .value=${this.plane}
        @change=${i=>this.showPlane(i.target.value)}></label>
      <input type="range" aria-label="Plane along the axis" min="0" max="1000" step="1" .value=${String(Number.isFinite(t)&&e>0?t/e*1e3:0)}
        aria-valuetext=${this.plane.trim()||"each plane"}
        @input=${i=>this.showPlane(_(Number((Number(i.target.value)/1e3*e).toPrecision(4))))}>
      <button ?disabled=${!this.plane.trim()} @click=${()=>this.showPlane("")}>Each plane</button></div>`}render(){let{bench:e}=this;return p`
      <header>
        <h1>vcc bench</h1>
        <div class="group">
          <button class="icon" title="Undo (Ctrl+Z)" aria-label="Undo" ?disabled=${!e.canUndo} @click=${()=>e.act({do:"undo"})}>${$("undo")}</button>
          <button class="icon" title="Redo (Ctrl+Shift+Z)" aria-label="Redo" ?disabled=${!e.canRedo} @click=${()=>e.act({do:"redo"})}>${$("redo")}</button>
        </div>
        ${e.side&&!e.canUndo&&!e.canRedo?p`<span class="quiet hint">Drag the sensor, or what stands before it.</span>`:u}
        <span class="spring"></span>
        ${e.parts?[this.opening(),this.keeping()]:u}
      </header>
      ${this.banner()}
      <section class="bench" aria-label="Optical bench">
        <vcc-bench-side .bench=${e}></vcc-bench-side>
      </section>
      <section class="picture" aria-label="Picture" aria-busy=${e.waiting||!e.picture}><vcc-bench-picture .bench=${e}></vcc-bench-picture></section>
      <section class="beside" aria-label="Parts and answers">
        ${this.tabs()}
        ${this.pane()}
      </section>
      <div class="toasts" role="status" aria-live="polite">${this.toasts()}</div>`}banner(){let{bench:e}=this;return e.open?u:p`<div class="banner" role="alert">${e.wasOpen?"The server is gone. What you see stays; the bench goes on when the server is back.":"Waiting for the server …"}</div>`}tabs(){let{bench:e}=this,t=[["parts","Parts"],["notes",e.notes.length?`Notes ${e.notes.length}`:"Notes"],...bt];return p`<div class="tabs" role="tablist" aria-label="Beside the picture" @keydown=${i=>{let n={ArrowRight:1,ArrowLeft:-1}[i.key];if(!n)return;let o=t.findIndex(([a])=>a===this.beside);this.show(t[(o+n+t.length)%t.length][0]),this.updateComplete.then(()=>this.renderRoot.querySelector('.tabs [aria-selected="true"]')?.focus())}}>
      ${t.map(([i,n])=>p`<button role="tab" id="beside-${i.replaceAll(" ","-")}" aria-selected=${this.beside===i} aria-controls="pane"
        tabindex=${this.beside===i?0:-1} @click=${()=>this.show(i)}>${n}</button>`)}
    </div>`}pane(){let{bench:e}=this,t=`beside-${this.beside.replaceAll(" ","-")}`;if(this.beside==="parts")return p`<div id="pane" class="pane" role="tabpanel" aria-labelledby=${t}><vcc-bench-editor .bench=${e}></vcc-bench-editor></div>`;if(this.beside==="notes")return p`<div id="pane" class="pane text" role="tabpanel" aria-labelledby=${t} tabindex="0">
        ${e.side?.words.map(n=>p`<p>${n}</p>`)}
        ${e.notes.length?u:p`<p class="quiet">Nothing to note: no ray misses, and nothing is too fine for the light field or the sensor.</p>`}
        ${e.notes.map(n=>p`<p class="advice">${n.element===null?u:p`<button class="link" @click=${()=>e.select(n.element)}>${e.partOf(n.element)?.label[0]??""}</button>`}${n.words}</p>`)}</div>`;let i=e.answer?.message.what===this.beside?e.answer:null;return p`<div id="pane" class="pane text answer" role="tabpanel" aria-labelledby=${t} tabindex="0" aria-busy=${!i}>
      ${Oe.includes(this.beside)?p`<label class="distance">point at <input type="text" placeholder="in focus" .value=${this.distance}
        @change=${n=>{this.distance=n.target.value,this.askAgain()}}></label>`:u}
      ${this.beside===Ce?this.planeField():u}
      ${i?vt(i):p`<p class="quiet">…</p>`}</div>`}toasts(){let{bench:e}=this,{progress:t,refused:i}=e;return p`
      ${i&&!this.saidAtField(i.where)?p`<div class="toast error"><span>${i.words}</span><button @click=${()=>e.forgive()}>Close</button></div>`:u}
      ${t?p`<div class="toast"><span>${t.words}</span><progress aria-label=${t.words} max=${t.total} value=${t.done}></progress></div>`:u}`}saidAtField(e){let{selected:t}=this.bench;return!e||this.beside!=="parts"||t==="light field"?!1:this.bench.whereOf(t).every((i,n)=>e[n]===i)&&e.length>(t==="sensor"?1:2)}opening(){let{bench:e}=this;return this.menu("Open",p`
      <button data-item @click=${t=>t.currentTarget.nextElementSibling.click()}>Camera file …</button>
      <input type="file" hidden accept=".toml" aria-label="Camera file" @change=${t=>{this.load(t.target)}}>
      ${e.parts.gallery.length?p`<hr>`:u}
      ${e.parts.gallery.map(t=>p`<button data-item @click=${()=>e.act({do:"load",gallery:t})}>${t}</button>`)}`)}async load(e){let t=e.files?.[0];t&&this.bench.act({do:"load",toml:await t.text()}),e.value=""}keeping(){return this.menu("Export",p`
      ${As.map(([e,t])=>p`<button data-item @click=${()=>this.bench.export(e)}>${t}</button>`)}
      <hr><button data-item data-stays aria-expanded=${this.film!==null} @click=${()=>this.film=this.film===null?"z":null}>Film of a sweep …</button>
      ${this.film===null?u:this.filming(this.film)}`)}filming(e){let{bench:t}=this,i=t.selected==="light field"?"sensor":t.selected,n=i==="sensor"?t.document.camera.sensor:t.elements[i]??{},o=t.parts.kinds.find(g=>g.kind===n.kind),a=(i==="sensor"?t.parts.sensor:o?.parameters??[]).filter(g=>g.takes.includes("number")&&N(String(n[g.name]??""))!==null),l=a.find(g=>g.name===e)??a[0],c=t.partOf(i)?.label[0]??"";if(!l)return p`<p class="quiet">${c} has no number to be swept.</p>`;let h=N(String(n[l.name])),d=l.name==="z"?.001/X(`1 ${h.unit}`):.2*Math.abs(h.number),m=g=>`${v(h.number+g*d,5)} ${h.unit}`.trim(),f=(g,x)=>{let w=T(String(g.get(x)),n[l.name],"");return l.unit?w:Number(w)};return p`<form @submit=${g=>{g.preventDefault();let x=g.target,w=new FormData(x);t.export("film",{where:[...t.whereOf(i),l.name],from:f(w,"from"),to:f(w,"to"),frames:Number(w.get("frames")),format:w.get("format")}),x.closest("details").open=!1,this.film=null}}>
      <label>${c} <select name="parameter" @change=${g=>this.film=g.target.value}>
        ${a.map(g=>p`<option value=${g.name} ?selected=${g===l}>${g.name.replaceAll("_"," ")}</option>`)}</select></label>
      <label>from <input type="text" name="from" .value=${m(-1)}></label>
      <label>to <input type="text" name="to" .value=${m(1)}></label>
      <label>frames <input type="number" name="frames" min="2" max="200" value="30"></label>
      <label>as <select name="format"><option value="gif">GIF</option><option value="mp4">MP4</option></select></label>
      <button class="main">Make the film</button></form>`}menu(e,t){return p`<details class="menu" @keydown=${i=>{let n=i.currentTarget;i.key==="Escape"&&(n.open=!1,n.querySelector("summary").focus(),i.stopPropagation());let o={ArrowDown:1,ArrowUp:-1}[i.key];if(!o||i.target.matches("input, select"))return;i.preventDefault(),n.open=!0;let a=[...n.querySelectorAll("[data-item]")],l=a.indexOf(i.target);a[(l+o+a.length)%a.length]?.focus()}}
      @focusout=${i=>{let n=i.currentTarget;i.relatedTarget&&!n.contains(i.relatedTarget)&&(n.open=!1)}}
      @click=${i=>{let n=i.currentTarget,o=i.target.closest("[data-item]");o&&!o.matches("[data-stays]")&&!o.nextElementSibling?.matches("input")&&(n.open=!1)}}>
      <summary>${e}${$("down")}</summary><div class="items">${t}</div></details>`}static{this.styles=[O,$t,k`
      :host {
        color-scheme: var(--bench-scheme, light dark);
        --ground: light-dark(#fbfbf9, #17191b);
        --well: light-dark(#ffffff, #101213);
        --stage: light-dark(#ecece8, #0d0e0f);
        --line: light-dark(#e2e2dd, #2c3034);
        --edge: light-dark(#b5b5ae, #555b61);
        --ink: light-dark(#1c1e20, #e9e8e4);
        --quiet: light-dark(#5f6469, #a0a6ab);
        --faint: light-dark(#a9abad, #5e6469);
        --accent: light-dark(#005f99, #6cc0f5);
        --hover: light-dark(rgb(0 0 0 / 5%), rgb(255 255 255 / 7%));
        --chosen: light-dark(#e1eef7, #17354a);
        --warn: light-dark(#e0a100, #e6b422);
        --on-warn: #1c1e20;
        --warn-ink: light-dark(#7a5600, #e6b422);
        --warn-ground: light-dark(#fdf3d8, #36301c);
        --error: light-dark(#b3261e, #ff9d94);
        --error-ground: light-dark(#fdeceb, #3d1f1d);
        --glass: light-dark(#cfe6f5, #29475b);
        --glass-edge: light-dark(#4a7a9c, #7fb2d3);
        --frost: light-dark(#e4e4dd, #4b4d4b);
        --frost-edge: light-dark(#8a8a80, #a9a99c);
        --focused: light-dark(#0072b2, #56b4e9);
        --near: light-dark(#d55e00, #f0883e);
        --far: light-dark(#a5457f, #d98bb9);
        --aside: light-dark(#00805c, #2fc394);
        --arrow: url("data:image/svg+xml,%3Csvg xmlns='http://www.w3.org/2000/svg' width='8' height='6' fill='none' stroke='%23808588' stroke-width='1.5'%3E%3Cpath d='m1 1 3 3 3-3'/%3E%3C/svg%3E");
        display: grid;
        position: relative;
        width: 100%;
        height: 100%;
        min-height: 0;
        background: var(--ground);
        text-align: start;
      }
      header { grid-area: header; display: flex; align-items: center; gap: 10px; padding: 0 8px 0 14px; height: 44px; border-bottom: 1px solid var(--line); position: relative; z-index: 3; }
      h1 { margin: 0; font-size: 13px; font-weight: 600; letter-spacing: -0.01em; }
      .group { display: flex; }
      .spring { flex: 1; }
      @container (max-width: 699px) { .hint { display: none; } }
      .bench { grid-area: bench; min-height: 0; min-width: 0; display: grid; border-bottom: 1px solid var(--line); }
      .picture { grid-area: picture; min-height: 0; min-width: 0; display: grid; border-left: var(--aside-border, 1px) solid var(--line); }
      .beside { grid-area: beside; min-height: 0; min-width: 0; display: flex; flex-direction: column; }
      .tabs { display: flex; gap: 2px; padding: 6px 8px 0; overflow-x: auto; scrollbar-width: none; flex: none; border-bottom: 1px solid var(--line); }
      .tabs button { border-radius: 6px 6px 0 0; height: 30px; color: var(--quiet); }
      .tabs button[aria-selected="true"] { background: none; color: var(--ink); font-weight: 600; box-shadow: inset 0 -2px var(--accent); }
      .pane { flex: 1; min-height: 0; display: grid; }
      .pane.text { display: block; overflow: auto; padding: 10px 14px; }
      .pane p { margin: 0 0 8px; }
      .pane pre { margin: 0; font: 11.5px/1.5 ui-monospace, "SF Mono", "DejaVu Sans Mono", monospace; white-space: pre-wrap; }
      .distance { display: flex; align-items: center; gap: 8px; margin-bottom: 10px; }
      .distance label { display: flex; align-items: center; gap: 8px; white-space: nowrap; }
      .distance input[type="text"] { width: 110px; }
      .distance input[type="range"] { flex: 1 1 60px; min-width: 60px; max-width: 260px; accent-color: var(--accent); }
      .advice { padding: 7px 10px; border-radius: 6px; background: var(--warn-ground); white-space: pre-line; }
      .link { height: auto; padding: 0 6px 0 0; font-weight: 600; text-decoration: underline; text-underline-offset: 2px; }
      .banner { grid-area: banner; padding: 7px 14px; background: var(--warn-ground); border-bottom: 1px solid var(--line); }
      .menu { position: relative; }
      .items { position: absolute; right: 0; top: 32px; min-width: 210px; max-height: 420px; overflow-y: auto; padding: 5px; background: var(--well); border: 1px solid var(--line); border-radius: 8px; box-shadow: 0 6px 24px rgb(0 0 0 / 14%); display: grid; }
      .items button { justify-content: start; }
      .items hr { width: 100%; border: 0; border-top: 1px solid var(--line); margin: 4px 0; }
      .items form { display: grid; gap: 6px; padding: 6px 9px; }
      .items form label { display: grid; grid-template-columns: 84px 1fr; align-items: center; overflow-wrap: anywhere; line-height: 1.2; }
      .items form select { border: 1px solid var(--line); background-color: var(--well); }
      .items .main { background: var(--accent); color: var(--ground); justify-content: center; }
      .toasts { position: absolute; left: 50%; bottom: 36px; translate: -50%; display: grid; gap: 8px; width: min(560px, 92%); pointer-events: none; z-index: 4; }
      .toast { display: flex; align-items: center; justify-content: space-between; gap: 12px; padding: 8px 8px 8px 14px; border-radius: 8px; border: 1px solid var(--line); background: var(--well); box-shadow: 0 6px 24px rgb(0 0 0 / 14%); pointer-events: auto; overflow-wrap: anywhere; }
      .toast.error { background: var(--error-ground); }
    `]}},Re=class extends S{render(){return p`<vcc-bench-view .bench=${this.bench}></vcc-bench-view>`}static{this.styles=k`
    :host { display: block; width: 100%; height: 100%; container-type: size; overflow: auto; }
    vcc-bench-view { grid-template: "header header" auto "banner banner" auto "bench picture" minmax(180px, 44fr) "beside picture" 56fr / minmax(0, 46fr) minmax(0, 54fr); }
    @container (max-width: 699px) {
      vcc-bench-view { --aside-border: 0px; height: auto; min-height: 100%; grid-template: "header" auto "banner" auto "picture" min(112cqw, 480px) "bench" 230px "beside" minmax(320px, auto) / minmax(0, 1fr); }
    }
  `}};function yt(){I("vcc-bench-side",ce),I("vcc-bench-picture",le),I("vcc-bench-editor",ae),I("vcc-bench-view",Le),I("vcc-bench",Re)}var Ms="520px";function wt(r,s,e={}){yt();let t=new Y(s,e),i=document.createElement("vcc-bench");return i.bench=t,r.append(i),t.start(),()=>{t.close(),i.remove()}}function _s(r){let s=new URL("bench",window.location.href);s.protocol=s.protocol.replace("http","ws"),s.hash="";let e=new URLSearchParams(window.location.search).get("token");return s.search=e===null?"":`?token=${encodeURIComponent(e)}`,wt(r,new ee(s.href),{address:!0})}function Ts(){let{body:r}=document;return r.dataset.jpThemeLight==="true"||r.classList.contains("vscode-light")?"light":r.dataset.jpThemeLight==="false"||r.classList.contains("vscode-dark")?"dark":""}function Ps({model:r,el:s}){let e=document.createElement("div");e.style.cssText=`width: 100%; height: ${s.style.height||Ms}`,e.dataset.lmSuppressShortcuts="true";let t=Ts();return t&&e.style.setProperty("--bench-scheme",t),s.append(e),wt(e,new te(r))}var xt=document.querySelector("main[data-vcc-bench]");xt&&_s(xt);var Di={render:Ps};export{Di as default,wt as mount};
